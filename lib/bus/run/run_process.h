/// The main of every stage's process: live on the bus, or over a log.
///   PROCESS --config DIR [--bus URL] [--memory DIR] [--realtime PRIORITY]       live, until SIGINT or SIGTERM
///   PROCESS --config DIR --log-in LOG --log-out LOG       the same handler over a log, deterministic
///   PROCESS --config DIR --print-config                   the effective configuration
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "bus/stage.h"

namespace roadfix {

using MakeStage = std::function<std::unique_ptr<Stage>(const std::filesystem::path& vehicle_dir)>;

/// The exit status: 0, or 2 for what the user can mend (printed to stderr).
int run_process(int argc, char** argv, const MakeStage& make);

/// Set by SIGINT and SIGTERM once this was called; the second signal of a kind ends the process at once.
void catch_stop_signals();
bool stop_requested();

}  // namespace roadfix
