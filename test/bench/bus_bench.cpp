// What the bus costs. Budget: 3 us of CPU per small message through a stage that does nothing, in replay
// (proof.replay_dispatch_us): reading the log, order, check, ledger, digest included.
#include <benchmark/benchmark.h>

#include "bus/run/replay.h"
#include "support/small_drive.h"
#include "support/temporary_folder.h"

using namespace roadfix;

namespace {

class IdleStage : public Stage {
 public:
  const StageSpec& spec() const override { return spec_; }
  void apply(const Message&) override {}
  void on_clock(const Message&) override {}
  void publish(int64_t, Outputs&) override {}
  void digest(Digest&) const override {}
  std::vector<uint8_t> save() const override { return {}; }
  void load(std::span<const uint8_t>) override {}
  std::string effective_config() const override { return {}; }

 private:
  StageSpec spec_{
      "idle", {{"IMU", "imu_t"}, {"WHEELS", "wheels_t", 50'000}, {"GNSS", "gnss_t", 250'000}}, {{0, 100'000}}, {}};
};

void BM_ReplayDispatch(benchmark::State& state) {
  const test::TemporaryFolder folder;
  test::write_drive(folder / "in.lcm", test::small_drive(static_cast<double>(state.range(0))));
  int64_t messages = 0;
  for ([[maybe_unused]] const auto _ : state) {
    std::vector<std::unique_ptr<Stage>> stages;
    stages.push_back(std::make_unique<IdleStage>());
    messages += replay(folder / "in.lcm", folder / "out.lcm", std::move(stages)).messages;
  }
  // In seconds; the console shows it with a unit prefix, the JSON as it is.
  state.counters["cpu_per_message_s"] =
      benchmark::Counter(static_cast<double>(messages), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_ReplayDispatch)->Arg(600)->Unit(benchmark::kMillisecond);

}  // namespace
