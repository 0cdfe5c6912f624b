/// Proves what a drive computed: runs every stage again from the recorded inputs and compares its outputs, byte for
/// byte, with those that were published in the car (docs/DESIGN.md, sections 1 and 4).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bus/verify/verify_run.h"

namespace roadfix {

struct StageVerdict {
  std::string stage;
  std::vector<std::string> config_differences;  ///< between the car and here; named before anything else
  std::vector<std::string> damage;              ///< recorded messages of its channels that are broken
  std::vector<RunVerdict> runs;

  [[nodiscard]] int64_t identical() const;
  [[nodiscard]] int64_t differing() const;
  [[nodiscard]] int64_t unverifiable() const;
};

struct VerifyReport {
  std::vector<StageVerdict> stages;     ///< those that the log has outputs of
  std::vector<std::string> log_damage;  ///< stretches of the files that hold no intact event
};

/// `logs`: one recording, however it was split. Throws LogError, and what making a stage throws.
VerifyReport verify(const std::vector<std::filesystem::path>& logs, const std::vector<NewStage>& stages);

}  // namespace roadfix
