/// Messages to the estimators' plain structs and back: units and enums, nothing else. Inputs were checked (schema.h).
#pragma once

#include <roadfix/gnss_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "samples/samples.h"

namespace roadfix {

ImuSample imu_sample(const imu_t& message);
WheelSample wheel_sample(const wheels_t& message);  ///< more than four speeds count as four
MagSample mag_sample(const mag_t& message);

/// utime and contents; the caller numbers them.
imu_t to_message(const ImuSample& sample);
gnss_t to_message(const GnssFix& fix);
wheels_t to_message(const WheelSample& sample);
mag_t to_message(const MagSample& sample);

Odometry odometry(const pose_t& message);
/// Fills time, pose, velocity, rates, covariances and validity; frame, origin, scale, state and resets are the
/// caller's.
void fill_pose(const Odometry& odometry, pose_t& message);

int8_t validity_code(Validity validity);
Validity validity_of(int8_t code);  ///< an unknown code is kInvalid

}  // namespace roadfix
