/// The subcommands of the tool: each adds itself to the application (kalibr: to calibrate).
#pragma once

namespace CLI {
class App;
}

namespace roadfix {

void add_calibrate_command(CLI::App& app);
void add_doctor_command(CLI::App& app);
void add_evaluate_command(CLI::App& app);
void add_export_command(CLI::App& app);
void add_fleet_command(CLI::App& app);
void add_import_command(CLI::App& app);
void add_kalibr_command(CLI::App& calibrate);
void add_log_command(CLI::App& app);
void add_paper_command(CLI::App& app);
void add_place_command(CLI::App& app);
void add_replay_command(CLI::App& app);
void add_run_command(CLI::App& app);
void add_simulate_command(CLI::App& app);
void add_verify_command(CLI::App& app);

}  // namespace roadfix
