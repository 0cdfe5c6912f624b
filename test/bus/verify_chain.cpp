// verify over the live tests' stages: verify_chain LOG...; prints one line "identical N differing N unverifiable N".
#include <iostream>
#include <roadfix/heartbeat_t.hpp>

#include "bus/stage_runner.h"
#include "bus/verify.h"
#include "support/chain_stage.h"

namespace {

/// Per stage, where there are any between two outputs: "filter: 2 heartbeats without a clock".
void tell_silences(const std::vector<std::filesystem::path>& logs) {
  using namespace roadfix;
  for (const StageSpec& spec : {test::odometry_spec(), test::filter_spec(), test::fusion_spec()}) {
    int64_t silent = 0;
    int64_t since_output = 0;
    bool ticked = false;
    for (const std::filesystem::path& log : logs) {
      LogReader reader(log);
      while (const auto event = reader.next()) {
        if (event->channel == spec.outputs[0].channel) {
          silent += ticked ? since_output : 0;
          since_output = 0;
          ticked = true;
        } else if (event->channel == stage_channel("HEARTBEAT_", spec.name)) {
          since_output += decode<heartbeat_t>(event->data).state == heartbeat_t::STATE_NO_CLOCK ? 1 : 0;
        }
      }
    }
    if (silent > 0) std::cout << spec.name << ": " << silent << " heartbeats without a clock\n";
  }
}

}  // namespace

int main(int argc, char** argv) {
  using namespace roadfix;
  std::vector<std::filesystem::path> logs(argv + 1, argv + argc);
  tell_silences(logs);
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
