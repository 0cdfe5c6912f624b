// Runs a fuzz target over its corpus where libFuzzer is not: each file whole, cut short, and with seeded damage.
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <set>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

constexpr int kDamagedCopies = 300;
constexpr int kCuts = 60;

void run(const std::vector<uint8_t>& bytes) { LLVMFuzzerTestOneInput(bytes.data(), bytes.size()); }

void run_damaged(const std::vector<uint8_t>& bytes, std::mt19937_64& random) {
  std::vector<uint8_t> copy = bytes;
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes && !copy.empty(); ++i) {
    const std::size_t at = random() % copy.size();
    switch (random() % 3) {
      case 0:
        copy[at] = static_cast<uint8_t>(random());
        break;
      case 1:
        copy.erase(copy.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      default:
        copy.insert(copy.begin() + static_cast<std::ptrdiff_t>(at), copy[random() % copy.size()]);
        break;
    }
  }
  run(copy);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || !std::filesystem::is_directory(argv[1])) {
    std::cerr << "usage: " << argv[0] << " CORPUS_FOLDER\n";
    return 2;
  }
  std::set<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) files.insert(entry.path());
  if (files.empty()) {
    std::cerr << argv[1] << ": holds no corpus\n";
    return 2;
  }
  std::mt19937_64 random(1);
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    run(bytes);
    for (int i = 0; i < kCuts; ++i) {
      const std::size_t length = bytes.size() * static_cast<std::size_t>(i) / kCuts;
      run({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)});
    }
    for (int i = 0; i < kDamagedCopies; ++i) run_damaged(bytes, random);
  }
  std::cout << files.size() << " files of the corpus, each in " << 1 + kCuts + kDamagedCopies << " versions\n";
  return 0;
}
