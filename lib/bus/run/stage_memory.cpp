#include "bus/run/stage_memory.h"

#include <fcntl.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "bus/run/stage_runner.h"
#include "bus/types/schema.h"

namespace roadfix {

int memory_input(const StageSpec& spec) {
  const std::string channel = stage_channel("START_", spec.name);
  for (std::size_t i = 0; i < spec.inputs.size(); ++i) {
    if (spec.inputs[i].channel == channel && spec.inputs[i].type == "state_t") return static_cast<int>(i);
  }
  return -1;
}

void write_memory(const std::filesystem::path& file, const state_t& memory) {
  const std::vector<uint8_t> bytes = encode(memory);
  const std::filesystem::path part = file.string() + ".part";
  const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  const bool written =
      fd >= 0 && ::write(fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()) && ::fsync(fd) == 0;
  if (fd >= 0) ::close(fd);
  if (!written || ::rename(part.c_str(), file.c_str()) != 0) {
    throw std::runtime_error(file.string() + ": cannot keep the state for the next start");
  }
}

std::optional<state_t> read_memory(const std::filesystem::path& file, const StageSpec& spec) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  const std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (Schema::built_in().check_of("state_t")(bytes) != CheckResult::kOk) {
    throw std::runtime_error(file.string() + ": damaged");
  }
  state_t memory = decode<state_t>(bytes);
  if (memory.process != spec.name || memory.layout != spec.state_layout) {
    throw std::runtime_error(file.string() + ": of " + memory.process + ", layout " + std::to_string(memory.layout) +
                             ", not " + spec.name + ", layout " + std::to_string(spec.state_layout));
  }
  return memory;
}

}  // namespace roadfix
