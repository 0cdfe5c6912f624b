// Any bytes as an event log: the reader ends, reports what it steps over, and every byte is in an event or in damage.
#include <cstdlib>

#include "bus/log/log_reader.h"
#include "bus/log/log_survey.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  roadfix::LogReader reader(std::span<const uint8_t>(data, size), "fuzz.lcm");
  uint64_t bytes = 0;
  while (const auto event = reader.next()) bytes += roadfix::log_event_bytes(*event);
  for (const roadfix::LogDamage& damage : reader.damage()) bytes += damage.bytes;
  if (bytes != size) std::abort();
  static_cast<void>(roadfix::survey_log(reader));
  return 0;
}
