// Runs a fuzzer without libFuzzer: over the seeds in the folder or the files given, and over a fixed number of mutations of them, the same
// ones every time.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "tests/fuzz/fuzz.h"

namespace {

using Bytes = std::vector<uint8_t>;

constexpr int kMutations = 2000;
constexpr size_t kLongest = 4096;

const Bytes* running = nullptr;

// A broken promise names its line; this names the input, for a regression seed.
void SayInput(int signal) {
  std::fputs("input:", stderr);
  for (uint8_t byte : *running) std::fprintf(stderr, " %02x", byte);
  std::fputs("\n", stderr);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void Run(const Bytes& input) {
  // Memory of just that length, so that a sanitizer sees a byte too many.
  const Bytes exact(input.begin(), input.end());
  running = &exact;
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

class Mutator {
 public:
  explicit Mutator(const std::vector<Bytes>& seeds) : seeds_(seeds) {}

  Bytes Next() {
    Bytes bytes = Seed();
    for (size_t i = Below(4) + 1; i > 0; --i) Mutate(bytes);
    bytes.resize(std::min(bytes.size(), kLongest));
    return bytes;
  }

 private:
  // Not a distribution of the library: those differ between libraries.
  size_t Below(size_t count) { return random_() % count; }
  const Bytes& Seed() { return seeds_[Below(seeds_.size())]; }
  static Bytes::iterator At(Bytes& bytes, size_t i) {
    return bytes.begin() + static_cast<ptrdiff_t>(i);
  }

  void Mutate(Bytes& bytes) {
    constexpr uint8_t kOdd[] = {0x00, 0x01, 0x7F, 0x80, 0xFF, '\n', '"', '-', '.', '0', '='};
    const size_t at = Below(bytes.size() + 1);
    const size_t count = Below(std::min<size_t>(bytes.size() - at, 16) + 1);
    switch (Below(7)) {
      case 0:
        if (at < bytes.size()) bytes[at] ^= static_cast<uint8_t>(1u << Below(8));
        break;
      case 1:
        if (at < bytes.size()) bytes[at] = kOdd[Below(std::size(kOdd))];
        break;
      case 2:
        bytes.insert(At(bytes, at), static_cast<uint8_t>(random_()));
        break;
      case 3:
        bytes.erase(At(bytes, at), At(bytes, at + count));
        break;
      case 4: {
        const Bytes piece(At(bytes, at), At(bytes, at + count));
        bytes.insert(At(bytes, Below(bytes.size() + 1)), piece.begin(), piece.end());
        break;
      }
      case 5:
        bytes.resize(at);
        break;
      default: {
        const Bytes& other = Seed();
        bytes.resize(at);
        const size_t from = Below(other.size() + 1);
        bytes.insert(bytes.end(), other.begin() + static_cast<ptrdiff_t>(from), other.end());
      }
    }
  }

  const std::vector<Bytes>& seeds_;
  std::mt19937_64 random_{1};
};

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    if (std::filesystem::is_directory(argv[i])) {
      for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
        files.push_back(entry.path());
      }
    } else {
      files.emplace_back(argv[i]);
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<Bytes> seeds;
  for (const std::filesystem::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    if (!in) {
      std::fprintf(stderr, "%s can not be read\n", file.c_str());
      return 2;
    }
  }
  if (seeds.empty()) {
    std::fputs("no seeds: give a folder with them, or files\n", stderr);
    return 2;
  }
  std::signal(SIGABRT, SayInput);
  Run({});
  for (const Bytes& seed : seeds) Run(seed);
  Mutator mutator(seeds);
  for (int i = 0; i < kMutations; ++i) Run(mutator.Next());
  std::printf("%zu seeds, %d mutations\n", seeds.size(), kMutations);
  return 0;
}
