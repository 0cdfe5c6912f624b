/// What estimators take for granted of a car on a road: assumptions about drivers, none of them measured.
#pragma once

namespace roadfix::vehicle {

inline constexpr double kReverseSpeed = 4.0;    ///< m/s, above which hardly a car is in reverse
inline constexpr double kStandingSpeed = 0.3;   ///< m/s, below which a car that shows no motion stands
inline constexpr double kStandingAccel = 0.03;  ///< m/s2, by which the mean specific force at rest may miss gravity
inline constexpr double kEverydayAccel = 1.5;   ///< m/s2, likewise in motion: what levelling takes for a slope
inline constexpr double kAside = 0.1;           ///< m/s, sigma of the velocity across the vehicle,
inline constexpr double kAsideShare = 0.05;     ///< and what sideslip adds, as a share of the speed
/// rad per m/s2, slip angle of the rear tyres by lateral acceleration, and how much cars differ: 1 to 3 deg per g.
inline constexpr double kRearSlip = 0.0036, kRearSlipStd = 0.002;
inline constexpr double kSlow = 2.0;            ///< m/s: slower, neither sideslip nor a factor on the speed shows
inline constexpr double kUnseenAccel = 2.0;     ///< m/s2, what may have happened in a while that nothing measured
inline constexpr double kStillVelocity = 0.05;  ///< m/s, sigma of a car that seems to stand: a pixel at 10 m in 0.4 s
inline constexpr double kLeastSpeed = 1.0;      ///< m/s: slower, its direction does not show

}  // namespace roadfix::vehicle
