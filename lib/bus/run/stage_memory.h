/// What a stage keeps across ignition: biases, scales, the place where the car was left. The process writes it to a
/// file now and then; at the next start it is published on START_<PROCESS> ahead of the first clock sample, so that it
/// is an input like any other: recorded, replayed, verified.
#pragma once

#include <filesystem>
#include <optional>
#include <roadfix/state_t.hpp>

#include "bus/stage.h"

namespace roadfix {

/// The input that brings it: of type state_t on START_<PROCESS>; -1 where the stage declares none.
int memory_input(const StageSpec& spec);

/// Replaces the file in one step, so that a power cut leaves the old one or the new one. Throws std::runtime_error.
void write_memory(const std::filesystem::path& file, const state_t& memory);

/// Nothing where there is no file. Throws std::runtime_error where it is damaged, of another process or layout.
std::optional<state_t> read_memory(const std::filesystem::path& file, const StageSpec& spec);

}  // namespace roadfix
