/// A 64-bit digest (XXH3) of values in the order they were added. Not cryptographic: it finds accidents, not attackers.
///
/// Numbers go in as their bytes, so two states have the same digest only where they have the same bits.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <span>
#include <vector>

namespace roadfix {

class Digest {
 public:
  void add(std::span<const uint8_t> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  void add(double value) { add_raw(&value, sizeof value); }
  void add(int64_t value) { add_raw(&value, sizeof value); }

  /// The coefficients, column by column (or row by row, where the matrix is stored so).
  template <class Derived>
  void add(const Eigen::PlainObjectBase<Derived>& matrix) {
    add_raw(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(typename Derived::Scalar));
  }

  /// Over everything added since the start or clear().
  [[nodiscard]] uint64_t value(uint64_t seed = 0) const;
  void clear() { bytes_.clear(); }

 private:
  void add_raw(const void* data, std::size_t size);

  std::vector<uint8_t> bytes_;
};

/// One digest out of an earlier one and some bytes: a chain that a snapshot can carry as one number.
[[nodiscard]] uint64_t chain_digest(uint64_t previous, std::span<const uint8_t> bytes);

}  // namespace roadfix
