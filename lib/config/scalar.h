/// Text to number and back, strictly: the whole text or nothing, no locale, shortest text that gives the same bits.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace roadfix {

/// A finite or infinite number or NaN, as std::from_chars reads it (an optional leading + besides); nothing else.
std::optional<double> parse_double(std::string_view text);
/// A decimal integer.
std::optional<int64_t> parse_integer(std::string_view text);

/// The shortest text that parse_double gives the same bits for.
std::string to_text(double value);

}  // namespace roadfix
