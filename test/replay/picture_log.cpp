// Writes the picture drive as a log, and its car's folder: picture_log LOG FOLDER
#include <fstream>
#include <iostream>

#include "support/picture_drive.h"

int main(int argc, char** argv) {
  using namespace roadfix;
  if (argc != 3) return 2;
  test::write_drive(argv[1], test::picture_drive());
  const std::filesystem::path folder = argv[2];
  std::filesystem::create_directories(folder);
  std::ofstream file(folder / "calibration.yaml");
  file << calibration_text(test::picture_car(true));
  return file.flush() ? 0 : 1;
}
