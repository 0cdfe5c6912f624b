// Files: raw bytes at a steady rate, and candump's lines at the pace of their stamps.
#include <fstream>
#include <thread>

#include "drivers/device/byte_source.h"
#include "drivers/protocols/candump.h"

namespace roadfix {

namespace {

using SteadyClock = std::chrono::steady_clock;

/// As much as a serial port would hand over at once.
constexpr double kPiece_s = 0.02;
constexpr std::size_t kMaxPiece = 4096;

std::ifstream open_stream(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SourceError(path + ": cannot be read");
  return file;
}

class FileSource : public ByteSource {
 public:
  FileSource(const std::string& path, double bytes_per_s)
      : path_(path), file_(open_stream(path)), bytes_per_s_(bytes_per_s), due_(SteadyClock::now()) {}

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override {
    const auto now = SteadyClock::now();
    if (due_ > now + timeout) {
      std::this_thread::sleep_for(timeout);
      return ReadState::kNothing;
    }
    std::this_thread::sleep_until(due_);
    const bool paced = bytes_per_s_ > 0.0;
    std::vector<uint8_t> piece(
        paced ? std::clamp<std::size_t>(static_cast<std::size_t>(bytes_per_s_ * kPiece_s), 1, kMaxPiece) : kMaxPiece);
    file_.read(reinterpret_cast<char*>(piece.data()), static_cast<std::streamsize>(piece.size()));
    piece.resize(static_cast<std::size_t>(file_.gcount()));
    if (piece.empty()) return ReadState::kEnd;
    if (paced) {
      due_ += std::chrono::duration_cast<SteadyClock::duration>(
          std::chrono::duration<double>(static_cast<double>(piece.size()) / bytes_per_s_));
    }
    packets.push_back({0, 0, std::move(piece)});
    return ReadState::kData;
  }
  [[nodiscard]] std::string name() const override { return path_; }

 private:
  std::string path_;
  std::ifstream file_;
  double bytes_per_s_;
  SteadyClock::time_point due_;
};

class CandumpSource : public ByteSource {
 public:
  explicit CandumpSource(const std::string& path) : path_(path), file_(open_stream(path)), begin_(SteadyClock::now()) {}

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override {
    const auto until = SteadyClock::now() + timeout;
    if (line_.empty() && !next_line()) return ReadState::kEnd;
    if (due_ > until) {
      std::this_thread::sleep_for(timeout);
      return ReadState::kNothing;
    }
    std::this_thread::sleep_until(due_);
    Packet packet;
    do {
      packet.bytes.insert(packet.bytes.end(), line_.begin(), line_.end());
    } while (packet.bytes.size() < kMaxPiece && next_line() && due_ <= SteadyClock::now());
    if (packet.bytes.size() >= kMaxPiece) line_.clear();
    packets.push_back(std::move(packet));
    return ReadState::kData;
  }
  [[nodiscard]] std::string name() const override { return path_; }

 private:
  /// A line that is none of candump's goes out at once, for the driver to count.
  bool next_line() {
    line_.clear();
    if (!std::getline(file_, line_)) return false;
    line_ += '\n';
    CanFrame frame;
    const std::span<const uint8_t> bytes(reinterpret_cast<const uint8_t*>(line_.data()), line_.size());
    if (!parse_can_line(bytes, frame)) return true;
    if (!first_us_) first_us_ = frame.t_us;
    due_ = begin_ + std::chrono::microseconds(frame.t_us - *first_us_);
    return true;
  }

  std::string path_;
  std::ifstream file_;
  SteadyClock::time_point begin_, due_{};
  std::optional<int64_t> first_us_;
  std::string line_;  ///< read, but not yet due
};

}  // namespace

std::unique_ptr<ByteSource> open_file(const std::string& path, double bytes_per_s) {
  return std::make_unique<FileSource>(path, bytes_per_s);
}

std::unique_ptr<ByteSource> open_candump(const std::string& path) { return std::make_unique<CandumpSource>(path); }

}  // namespace roadfix
