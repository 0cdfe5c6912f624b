#include "bus/run/run_process.h"
#include "vo_tracker/handler.h"

int main(int argc, char** argv) {
  return roadfix::run_process(argc, argv,
                              [](const std::filesystem::path& vehicle) { return roadfix::make_vo_tracker(vehicle); });
}
