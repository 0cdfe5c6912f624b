// A camera that hangs must not hang its driver: a made source behind the same interface, whose reads may block.
#include "drivers/device/threaded_source.h"

#include <catch2/catch.hpp>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "drivers/camera_driver/handler.h"
#include "drivers/camera_driver/pnm.h"
#include "support/driver_bench.h"

namespace roadfix {
namespace {

using SteadyClock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// What the made camera does, told from outside.
struct Made {
  std::mutex mutex;
  std::condition_variable changed;
  bool hangs = false;
  bool lost = false;
  bool in_read = false;
  int reads = 0;
  int gone = 0;  ///< sources that were closed

  template <class Done>
  bool wait(const Done& done, milliseconds timeout = milliseconds(60'000)) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, timeout, done);
  }
  void set(bool& what, bool to) {
    const std::lock_guard lock(mutex);
    what = to;
    changed.notify_all();
  }
};

/// A picture every 10 ms, its number as its only byte or as its grey.
class MadeCamera : public ByteSource {
 public:
  MadeCamera(std::shared_ptr<Made> made, ThreadedSource::Now now, bool pictures)
      : made_(std::move(made)), now_(std::move(now)), pictures_(pictures) {}
  ~MadeCamera() override {
    const std::lock_guard lock(made_->mutex);
    ++made_->gone;
    made_->changed.notify_all();
  }

  ReadState read(milliseconds, std::vector<Packet>& packets) override {
    std::this_thread::sleep_for(milliseconds(10));
    std::unique_lock lock(made_->mutex);
    made_->in_read = true;
    made_->changed.notify_all();
    made_->changed.wait(lock, [this] { return !made_->hangs; });
    if (made_->lost) return ReadState::kLost;
    const auto number = static_cast<uint8_t>(made_->reads++);
    packets.push_back(
        {0, now_(), pictures_ ? write_pnm(cv::Mat(4, 6, CV_8UC1, cv::Scalar(number))) : std::vector<uint8_t>{number}});
    return ReadState::kData;
  }
  [[nodiscard]] std::string name() const override { return "made"; }

 private:
  std::shared_ptr<Made> made_;
  ThreadedSource::Now now_;
  bool pictures_;
};

int64_t wall_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::unique_ptr<ThreadedSource> threaded(const std::shared_ptr<Made>& made, bool pictures = false) {
  const auto open = [&](const ThreadedSource::Now& now) { return std::make_unique<MadeCamera>(made, now, pictures); };
  return std::make_unique<ThreadedSource>(open, wall_us);
}

double seconds_of(const std::function<void()>& work) {
  const auto begin = SteadyClock::now();
  work();
  return std::chrono::duration<double>(SteadyClock::now() - begin).count();
}

TEST_CASE("a source in a thread: all packets in order, stamped when they were read, then that it is lost") {
  const auto made = std::make_shared<Made>();
  const auto source = threaded(made);
  CHECK(source->name() == "made");
  std::vector<Packet> packets;
  const int64_t begin = wall_us();
  while (packets.size() < 5) REQUIRE(source->read(milliseconds(60'000), packets) == ReadState::kData);
  CHECK(made->wait([&] { return made->reads >= static_cast<int>(packets.size()) + 4; }));  // as many as may wait
  std::this_thread::sleep_for(milliseconds(200));                                          // what waits now is old
  const int64_t late = wall_us();
  made->set(made->lost, true);
  ReadState state = ReadState::kData;
  while (state == ReadState::kData) state = source->read(milliseconds(60'000), packets);
  CHECK(state == ReadState::kLost);
  CHECK(source->read(milliseconds(0), packets) == ReadState::kLost);
  REQUIRE(packets.size() > 5);
  CHECK(packets.size() < 15);  // of 20 in that time: nobody took them, so it was not read
  CHECK(made->wait([&] { return static_cast<int>(packets.size()) == made->reads; }, milliseconds(0)));
  for (std::size_t i = 0; i < packets.size(); ++i) {
    CHECK(packets[i].bytes == std::vector<uint8_t>{static_cast<uint8_t>(i)});
    CHECK(packets[i].utime > (i == 0 ? begin - 1'000'000 : packets[i - 1].utime));
  }
  CHECK(packets[5].utime < late - 50'000);
}

TEST_CASE("a source that hangs costs its reader the patience, and goes on when it goes on") {
  const auto made = std::make_shared<Made>();
  const auto source = threaded(made);
  std::vector<Packet> packets;
  REQUIRE(source->read(milliseconds(60'000), packets) == ReadState::kData);
  made->set(made->hangs, true);
  std::this_thread::sleep_for(milliseconds(50));
  static_cast<void>(source->read(milliseconds(0), packets));
  const double took_s = seconds_of([&] { CHECK(source->read(milliseconds(50), packets) == ReadState::kNothing); });
  CHECK(took_s > 0.045);
  CHECK(took_s < 60.0);
  made->set(made->hangs, false);
  CHECK(source->read(milliseconds(60'000), packets) == ReadState::kData);
}

TEST_CASE("a source that hangs is left behind, and closed when its read ends") {
  const auto made = std::make_shared<Made>();
  made->hangs = true;
  auto source = threaded(made);
  CHECK(made->wait([&] { return made->in_read; }));
  CHECK(seconds_of([&] { source.reset(); }) < 60.0);
  CHECK_FALSE(made->wait([&] { return made->gone > 0; }, milliseconds(50)));
  made->set(made->hangs, false);
  CHECK(made->wait([&] { return made->gone == 1; }));
  auto other = threaded(made);
  CHECK(seconds_of([&] { other.reset(); }) < 60.0);
  CHECK(made->wait([&] { return made->gone == 2; },
                   milliseconds(0)));  // one that does not hang is closed at once, and may be opened again
}

TEST_CASE("a camera that hangs: the driver's heart beats, says so, and the pictures go on") {
  const auto made = std::make_shared<Made>();
  CameraDriverConfig config;
  config.devices = {"made"};
  config.silence = 0.3;
  DriverSetup setup = camera_driver_setup(config);
  setup.open = [&](const std::function<int64_t()>&) { return threaded(made, true); };
  test::Bench bench(setup);
  REQUIRE(bench.step_until([&] { return bench.count("CAMERA_LEFT") >= 5; }));
  made->set(made->hangs, true);
  const std::size_t beats = bench.count("HEARTBEAT_CAMERA_DRIVER");
  REQUIRE(bench.step_until([&] { return bench.count("HEARTBEAT_CAMERA_DRIVER") >= beats + 2; }));
  CHECK_THAT(bench.heartbeat().state_reason, Catch::Contains("made: no byte for"));
  const std::size_t pictures = bench.count("CAMERA_LEFT");
  made->set(made->hangs, false);
  REQUIRE(bench.step_until([&] { return bench.count("CAMERA_LEFT") > pictures + 5; }));
  CHECK(bench.driver().state_reason().empty());
}

}  // namespace
}  // namespace roadfix
