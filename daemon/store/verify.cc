#include "daemon/store/verify.h"

#include <map>

#include "base/status.h"
#include "daemon/store/layout.h"
#include "dataset/basis_exr.h"
#include "dataset/light_positions.h"
#include "dataset/manifest.h"
#include "dataset/record_json.h"
#include "dataset/sha256.h"

namespace lightstage {
namespace {

absl::Status Loss(std::string_view reason, std::string_view message) {
  return Error(absl::StatusCode::kDataLoss, reason, message);
}

absl::Status CheckImage(const RunFolder& run, const ShotRecord& record) {
  ASSIGN_OR_RETURN(std::string path, run.PathOf(record.file));
  ASSIGN_OR_RETURN(std::string bytes, run.env().ReadFile(path));
  if (bytes.size() != record.bytes) {
    return Loss("FILE_SIZE",
                absl::StrCat("has ", bytes.size(), " bytes, its record says ", record.bytes));
  }
  if (std::string sum = Sha256Hex(bytes); sum != record.sha256) {
    return Loss("FILE_CHECKSUM",
                absl::StrCat("has SHA-256 ", sum, ", its record says ", record.sha256));
  }
  ASSIGN_OR_RETURN(BasisHeader header, ReadBasisHeader(bytes, record.file));
  const RunHeader& expected = run.header();
  if (header.width != expected.width || header.height != expected.height ||
      header.channels != expected.channels) {
    return Loss("IMAGE_SHAPE",
                absl::StrCat("is ", header.width, "x", header.height, "x", header.channels,
                             ", the run's images are ", expected.width, "x", expected.height, "x",
                             expected.channels));
  }
  if (header.attributes.shot.id != record.shot.id || header.attributes.run_id != expected.id) {
    return Loss("IMAGE_IDENTITY",
                absl::StrCat("says it is shot ", header.attributes.shot.id, " of run ",
                             header.attributes.run_id, ", must be shot ", record.shot.id,
                             " of run ", expected.id));
  }
  return absl::OkStatus();
}

absl::Status CheckManifest(const RunFolder& run,
                           const std::map<uint64_t, const ShotRecord*>& records) {
  ASSIGN_OR_RETURN(Manifest manifest, ReadManifest(run.path(), run.env()));
  if (manifest.run_id != run.header().id) {
    return Loss("MANIFEST_MISMATCH",
                absl::StrCat("is of run ", manifest.run_id, ", must be of ", run.header().id));
  }
  if (manifest.shots.size() != records.size()) {
    return Loss("MANIFEST_MISMATCH", absl::StrCat("holds ", manifest.shots.size(),
                                                  " shots, the journal ", records.size()));
  }
  auto expected = records.begin();
  for (const ShotRecord& shot : manifest.shots) {
    if (ToJson(shot) != ToJson(*(expected++)->second)) {
      return Loss("MANIFEST_MISMATCH",
                  absl::StrCat("shot ", shot.shot.id, " differs from its journal record"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckLights(const RunFolder& run, const std::string& file,
                         const std::string& expected) {
  ASSIGN_OR_RETURN(std::string path, run.PathOf(file));
  ASSIGN_OR_RETURN(std::string text, run.env().ReadFile(path));
  if (text != expected)
    return Loss("LIGHTS_MISMATCH", "differs from the directions in the journal");
  return absl::OkStatus();
}

class Verification {
 public:
  Verification(const RunFolder& run, const VerifyHooks& hooks) : run_(run), hooks_(hooks) {}

  absl::StatusOr<std::vector<VerifyProblem>> Run() {
    std::vector<ShotRecord> records = run_.Records(0, UINT64_MAX);
    std::map<uint64_t, const ShotRecord*> by_id;
    for (const ShotRecord& record : records) by_id[record.shot.id] = &record;
    const bool whole = !run_.appending();
    const bool finished = whole && run_.state().state == RunState::kSucceeded;
    std::vector<std::string> lights;
    if (finished) {
      std::vector<ShotRecord> ordered;
      for (const auto& [id, record] : by_id) ordered.push_back(*record);
      lights = WriteLightPositions(ordered, run_.header().geometry.camera);
    }
    total_ = 1 + records.size() + (finished ? 1 + lights.size() : 0);

    RETURN_IF_ERROR(Next());
    Note(kJournalFile, run_.damage());
    if (whole && run_.torn_bytes() > 0) {
      Note(kJournalFile, Loss("JOURNAL_TORN", absl::StrCat("ends in ", run_.torn_bytes(),
                                                           " bytes that are no whole line")));
    }
    for (const ShotRecord& record : records) {
      RETURN_IF_ERROR(Next());
      Note(record.file, CheckImage(run_, record));
    }
    if (whole) RETURN_IF_ERROR(NoteUnrecorded(records));
    if (finished) {
      // A damaged journal is told already: that records are missing follows from it.
      if (run_.damage().ok() && records.size() != run_.header().expected_shots) {
        Note(kJournalFile,
             Loss("SHOTS_MISSING", absl::StrCat("holds ", records.size(), " of ",
                                                run_.header().expected_shots, " shots")));
      }
      RETURN_IF_ERROR(Next());
      Note(kManifestFile, CheckManifest(run_, by_id));
      for (size_t i = 0; i < lights.size(); ++i) {
        RETURN_IF_ERROR(Next());
        Note(LightFileName(i), CheckLights(run_, LightFileName(i), lights[i]));
      }
    }
    if (hooks_.progress) hooks_.progress(total_, total_);
    return std::move(problems_);
  }

 private:
  absl::Status Next() {
    if (hooks_.cancelled && hooks_.cancelled()) {
      return Error(absl::StatusCode::kCancelled, "VERIFY_CANCELLED",
                   absl::StrCat("verification of run ", run_.header().id, " was cancelled"));
    }
    if (hooks_.progress) hooks_.progress(begun_, total_);
    ++begun_;
    return absl::OkStatus();
  }

  void Note(std::string file, const absl::Status& status) {
    if (status.ok()) return;
    problems_.push_back({std::move(file), status});
    if (hooks_.problem) hooks_.problem(problems_.back());
  }

  absl::Status NoteUnrecorded(const std::vector<ShotRecord>& records) {
    std::map<std::string, int> recorded;
    for (const ShotRecord& record : records) ++recorded[record.file];
    ASSIGN_OR_RETURN(std::vector<FolderFile> files, run_.ListFiles());
    for (const FolderFile& file : files) {
      bool image = file.path.find('/') != std::string::npos;
      if (image && recorded.count(file.path) == 0) {
        Note(file.path, Loss("FILE_UNRECORDED", "is in no journal record"));
      }
    }
    return absl::OkStatus();
  }

  const RunFolder& run_;
  const VerifyHooks& hooks_;
  uint64_t begun_ = 0, total_ = 0;
  std::vector<VerifyProblem> problems_;
};

}  // namespace

absl::StatusOr<std::vector<VerifyProblem>> Verify(const RunFolder& run, const VerifyHooks& hooks) {
  return Verification(run, hooks).Run();
}

}  // namespace lightstage
