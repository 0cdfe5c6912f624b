/// Which key a user probably meant.
#pragma once

#include <string>
#include <vector>

namespace roadfix {

/// The known key closest to `unknown`, empty where none is close. A key that differs in its unit suffix alone is
/// closest of all.
std::string closest_key(const std::string& unknown, const std::vector<std::string>& known);

/// Are the two the same quantity in different units (gyro_noise_degps, gyro_noise_radps)?
bool differ_in_unit_only(const std::string& a, const std::string& b);

}  // namespace roadfix
