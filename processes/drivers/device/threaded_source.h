/// A source whose read() may block for much longer than it is asked to wait (OpenCV on a camera that hangs: ten
/// seconds): it is read in a thread of its own, so that whoever drives it goes on, reports the silence and feeds its
/// watchdog.
#pragma once

#include <functional>

#include "drivers/device/byte_source.h"

namespace roadfix {

class ThreadedSource : public ByteSource {
 public:
  using Now = std::function<int64_t()>;
  using Open = std::function<std::unique_ptr<ByteSource>(const Now&)>;

  /// Opens the source here, so that what open() throws comes through. What the source gets to stamp its packets with is
  /// a clock that its thread may read; read() maps the stamps to `now`, which only the caller's thread asks.
  ThreadedSource(const Open& open, Now now);

  /// Waits for a hanging read a moment only; its thread then ends when the read does.
  ~ThreadedSource() override;
  ThreadedSource(const ThreadedSource&) = delete;
  ThreadedSource& operator=(const ThreadedSource&) = delete;

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override;
  [[nodiscard]] std::string name() const override { return name_; }

 private:
  struct Shared;
  static void read_all(const std::shared_ptr<Shared>& shared);

  std::shared_ptr<Shared> shared_;
  Now now_;
  std::string name_;
};

}  // namespace roadfix
