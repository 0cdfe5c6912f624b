// verify over the live tests' stages: verify_chain LOG...; prints one line "identical N differing N unverifiable N".
#include <algorithm>
#include <iostream>
#include <roadfix/heartbeat_t.hpp>

#include "bus/run/stage_runner.h"
#include "bus/verify/verify.h"
#include "support/chain_stage.h"

namespace {

/// What the stages' heartbeats say: "filter: 2 heartbeats without a clock" (those between two outputs), "filter: 7
/// datagrams dropped by the kernel"; nothing where there are none.
void tell_heartbeats(const std::vector<std::filesystem::path>& logs) {
  using namespace roadfix;
  for (const StageSpec& spec : {test::odometry_spec(), test::filter_spec(), test::fusion_spec()}) {
    int64_t silent = 0;
    int64_t since_output = 0;
    bool ticked = false;
    int64_t kernel_drops = 0;
    for (const std::filesystem::path& log : logs) {
      LogReader reader(log);
      while (const auto event = reader.next()) {
        if (event->channel == spec.outputs[0].channel) {
          silent += ticked ? since_output : 0;
          since_output = 0;
          ticked = true;
        } else if (event->channel == stage_channel("HEARTBEAT_", spec.name)) {
          const auto heartbeat = decode<heartbeat_t>(event->data);
          since_output += heartbeat.state == heartbeat_t::STATE_NO_CLOCK ? 1 : 0;
          kernel_drops = std::max(kernel_drops, heartbeat.kernel_drops);
        }
      }
    }
    if (silent > 0) std::cout << spec.name << ": " << silent << " heartbeats without a clock\n";
    if (kernel_drops > 0) std::cout << spec.name << ": " << kernel_drops << " datagrams dropped by the kernel\n";
  }
}

}  // namespace

int main(int argc, char** argv) {
  using namespace roadfix;
  std::vector<std::filesystem::path> logs(argv + 1, argv + argc);
  tell_heartbeats(logs);
  std::vector<NewStage> stages;
  for (const StageSpec& spec : {test::odometry_spec(), test::filter_spec(), test::fusion_spec()}) {
    stages.push_back([spec] { return std::make_unique<test::ChainStage>(spec); });
  }
  int64_t identical = 0;
  int64_t differing = 0;
  int64_t unverifiable = 0;
  for (const StageVerdict& stage : verify(logs, stages).stages) {
    identical += stage.identical();
    differing += stage.differing();
    unverifiable += stage.unverifiable();
    for (const std::string& difference : stage.config_differences)
      std::cout << stage.stage << ": " << difference << "\n";
    for (const RunVerdict& run : stage.runs) {
      std::cout << stage.stage << " run " << run.run << ": " << run.identical << " identical, " << run.differing
                << " differing, " << run.unverifiable << " unverifiable\n";
      for (const std::string& loss : run.losses) std::cout << "  lost by the logger: " << loss << "\n";
      for (const std::string& finding : run.findings) std::cout << "  finding: " << finding << "\n";
      if (run.first_difference) std::cout << "  first difference: " << *run.first_difference << "\n";
    }
  }
  std::cout << "identical " << identical << " differing " << differing << " unverifiable " << unverifiable << "\n";
  return differing == 0 && identical > 0 ? 0 : 1;
}
