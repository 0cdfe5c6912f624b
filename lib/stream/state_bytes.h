/// Serialised states: values in call order, in machine byte order (x86-64 and ARM64 agree). Reading past the end or
/// leaving bytes unread throws.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace roadfix {

class StateWriter {
 public:
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void put(T value) { put_raw(&value, sizeof value); }
  void put(const std::string& text) {
    put(static_cast<int64_t>(text.size()));
    put_raw(text.data(), text.size());
  }
  void put(std::span<const uint8_t> bytes) {
    put(static_cast<int64_t>(bytes.size()));
    put_raw(bytes.data(), bytes.size());
  }
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void put(const std::optional<T>& value) {
    put(value.has_value());
    put(value.value_or(T{}));
  }
  /// Of a size known to the reader.
  template <class Derived>
  void put(const Eigen::PlainObjectBase<Derived>& matrix) {
    put_raw(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(typename Derived::Scalar));
  }

  [[nodiscard]] std::vector<uint8_t> take() { return std::move(bytes_); }

 private:
  void put_raw(const void* data, std::size_t size) {
    if (size == 0) return;
    const std::size_t used = bytes_.size();
    bytes_.resize(used + size);  // insert() draws a false overflow warning from GCC 12 where it is inlined
    std::memcpy(bytes_.data() + used, data, size);
  }

  std::vector<uint8_t> bytes_;
};

class StateReader {
 public:
  explicit StateReader(std::span<const uint8_t> bytes) : rest_(bytes) {}

  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void get(T& value) { get_raw(&value, sizeof value); }
  void get(std::string& text) {
    const std::span<const uint8_t> bytes = get_block();
    text.assign(bytes.begin(), bytes.end());
  }
  void get(std::vector<uint8_t>& block) {
    const std::span<const uint8_t> bytes = get_block();
    block.assign(bytes.begin(), bytes.end());
  }
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void get(std::optional<T>& value) {
    const bool present = get<bool>();
    value = get<T>();
    if (!present) value.reset();
  }
  template <class Derived>
  void get(Eigen::PlainObjectBase<Derived>& matrix) {
    get_raw(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(typename Derived::Scalar));
  }
  template <class T>
  [[nodiscard]] T get() {
    T value{};
    get(value);
    return value;
  }

  /// Throws unless everything was read.
  void finish() const {
    if (!rest_.empty()) throw std::runtime_error("state: " + std::to_string(rest_.size()) + " bytes left over");
  }

 private:
  void get_raw(void* data, std::size_t size) {
    if (size > rest_.size()) throw std::runtime_error("state: ends too early");
    if (size > 0) std::memcpy(data, rest_.data(), size);
    rest_ = rest_.subspan(size);
  }
  std::span<const uint8_t> get_block() {
    const auto size = get<int64_t>();
    if (size < 0 || static_cast<uint64_t>(size) > rest_.size()) throw std::runtime_error("state: ends too early");
    const std::span<const uint8_t> block = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(static_cast<std::size_t>(size));
    return block;
  }

  std::span<const uint8_t> rest_;
};

/// Both as one kind of visitor, so that one member list serves writing and reading: a(first, second, ...).
struct StateArchiveOut {
  static constexpr bool kReads = false;
  StateWriter out;
  template <class... T>
  void operator()(const T&... values) {
    (out.put(values), ...);
  }
};

struct StateArchiveIn {
  static constexpr bool kReads = true;
  StateReader in;
  template <class... T>
  void operator()(T&&... values) {
    (in.get(values), ...);
  }
};

}  // namespace roadfix
