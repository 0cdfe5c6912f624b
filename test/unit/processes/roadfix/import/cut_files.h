/// Every file of a recording cut short at many places: import must tell, and leave nothing half written.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace roadfix::test {

struct Cuts {
  int refused = 0;
  int taken = 0;                        ///< what was left is whole in itself: whole rows, a shorter number
  std::vector<std::string> complaints;  ///< empty where all is well
};

/// Cuts each file below `root`, imports `source` (which lies in it) and puts the file back. A complaint is an error that
/// names no file of the recording, an output that is there after an error, a damaged file that was taken.
Cuts cut_every_file(const std::filesystem::path& root, const std::filesystem::path& source);

}  // namespace roadfix::test
