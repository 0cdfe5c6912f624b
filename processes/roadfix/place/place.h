/// Tells a running gnss_ins_ekf where the car is: a person's word, as a measurement with a sigma.
#pragma once

#include <chrono>
#include <string>

#include "bus/bus.h"
#include "samples/samples.h"

namespace roadfix {

struct PlaceAnswer {
  bool used = false;
  std::string text;  ///< for a person
};

/// Publishes PRIOR_POSE and reads what AIDING_INS says of it, for at most `patience`.
PlaceAnswer tell_place(Bus& bus, const PriorPose& told, int64_t run, std::chrono::milliseconds patience);

}  // namespace roadfix
