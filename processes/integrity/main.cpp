#include "bus/run/run_process.h"
#include "integrity/handler.h"

int main(int argc, char** argv) {
  return roadfix::run_process(
      argc, argv, [](const std::filesystem::path& vehicle_dir) { return roadfix::make_integrity(vehicle_dir); });
}
