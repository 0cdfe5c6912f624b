// Whatever bytes stand in a configuration, the reader gives values or a ConfigError; and what it accepts, the writer
// writes so that it is read back as the same.
#include <cstdint>
#include <stdexcept>
#include <string>

#include "config/config.h"
#include "evaluation/drive_facts.h"
#include "roadfix/import/drive_folder.h"

namespace {

template <class T, class Write>
void require_round_trip(const T& value, const Write& write, T (*read)(const std::string&, const std::string&)) {
  const std::string text = write(value);
  if (write(read(text, "written")) != text) throw std::logic_error("written YAML reads back as something else");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(data, data + size);
  try {
    const roadfix::DriveDescription description = roadfix::parse_drive_description(text, "fuzz.yaml");
    require_round_trip<roadfix::Calibration>(description.calibration, roadfix::calibration_text,
                                             roadfix::parse_calibration);
  } catch (const roadfix::ConfigError&) {
  }
  try {
    const auto facts = roadfix::parse_config<roadfix::DriveFacts>(text, "fuzz.yaml");
    const std::string written = roadfix::config_text(facts);
    if (roadfix::config_text(roadfix::parse_config<roadfix::DriveFacts>(written, "written")) != written) {
      throw std::logic_error("written YAML reads back as something else");
    }
  } catch (const roadfix::ConfigError&) {
  }
  return 0;
}
