/// How the receiver's errors in the state begin, end and are asked anew, (N.5.1), (N.5.2) and (N.5.12) of MODEL.md. All move
/// the covariance to the state's epoch first.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// s without a receiver, after which its errors are new and compared with nothing.
inline constexpr double kOutage = 3.0;

/// The errors of positions are zero now, with these standard deviations (m, level axes), without correlation with
/// anything else.
void reset_gnss_bias(Filter& filter, const Eigen::Vector3d& std);
/// The prior variance of the error at kGnssBias or kGnssVelocityBias becomes `ratio` times what it was, (N.5.12): as if it
/// had been measured as zero, or such a measurement were taken back. `stationary`: its variance then, (m or m/s)^2, level
/// axes; no measurement is taken back that would make it larger.
void rescale_gnss_bias(Filter& filter, int at, double ratio, const Eigen::Vector3d& stationary);

/// The receiver comes back from an outage with an error of this standard deviation (m, level axes) that fades at a rate
/// nobody knows, (N.5.2).
void begin_gnss_return(Filter& filter, const Eigen::Vector3d& std);
void end_gnss_return(Filter& filter);
/// m, root mean square of what may be left of it: the largest of the level axes.
double gnss_return_size(const State& state);

}  // namespace roadfix::navigation
