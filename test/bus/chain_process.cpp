// A stage's process for the live tests: the last folder of --config names the stage (odometry, filter or fusion).
#include "bus/run/run_process.h"
#include "support/chain_stage.h"

int main(int argc, char** argv) {
  using namespace roadfix;
  return run_process(argc, argv, [](const std::filesystem::path& vehicle_dir) {
    for (const StageSpec& spec : {test::odometry_spec(), test::filter_spec(), test::fusion_spec()}) {
      if (spec.name == vehicle_dir.filename()) return std::make_unique<test::ChainStage>(spec);
    }
    throw std::runtime_error("--config: no such stage: " + vehicle_dir.string());
  });
}
