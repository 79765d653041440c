// Names in a data directory and in a run's folder (docs/DATASET.md).
#pragma once

namespace lightstage {

inline constexpr char kRunsFolder[] = "runs";
inline constexpr char kLockFile[] = "lightstaged.lock";

inline constexpr char kRunFile[] = "run.json";
inline constexpr char kRigFile[] = "rig.toml";
inline constexpr char kJournalFile[] = "journal";
inline constexpr const char* kImageFolders[] = {"basis", "dark",
                                                "reference"};  // ShotKindName of each kind
inline constexpr char kImageSuffix[] = ".exr";
inline constexpr char kTemporarySuffix[] = ".tmp";  // of Env::WriteFile's temporary files

}  // namespace lightstage
