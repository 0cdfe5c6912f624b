#include "bus/run/run_process.h"
#include "gnss_ins_ekf/handler.h"

int main(int argc, char** argv) {
  return roadfix::run_process(argc, argv,
                              [](const std::filesystem::path& vehicle) { return roadfix::make_gnss_ins_ekf(vehicle); });
}
