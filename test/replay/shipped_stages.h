/// Every stage that a car runs, each with a short drive that holds all of its inputs.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bus/stage.h"
#include "config/calibration.h"
#include "support/recorded_car.h"

namespace roadfix::test {

struct ShippedStage {
  std::string title;
  Calibration calibration;
  std::function<std::unique_ptr<Stage>(const Calibration&)> make;
  const std::vector<DriveMessage>& (*drive)();

  [[nodiscard]] std::unique_ptr<Stage> made() const { return make(calibration); }
};

/// Both modes of the camera tracker among them.
const std::vector<ShippedStage>& shipped_stages();

/// A message on its way to a stage.
struct Delivery {
  int64_t arrives = 0;
  int order = 0;
  int input = 0;
  const DriveMessage* message = nullptr;
};

struct Arrivals {
  std::optional<unsigned> seed;  ///< without one nothing is late
  bool duplicates = false;       ///< every third message twice
  int64_t extra_us = 0;          ///< beyond what is allowed
};

/// The stage's inputs as they arrive: the first clock in its own order, the others behind by less than their lateness
/// and the delay of their effect.
std::vector<Delivery> deliveries(const StageSpec& spec, const std::vector<DriveMessage>& drive,
                                 const Arrivals& arrivals = {});

/// What a logger beside the stage writes: configuration, inputs as they come, outputs, snapshots, ledger.
std::vector<LoggedEvent> record(const ShippedStage& stage);

}  // namespace roadfix::test
