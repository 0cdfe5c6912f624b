/// Serialisation of member lists: one list serves saving and loading.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "geometry/se3.h"
#include "stream/state_bytes.h"

namespace roadfix {

inline void put_pose(const SE3& T, StateWriter& writer) {
  writer.put(T.q.coeffs());
  writer.put(T.p);
}

inline void get_pose(SE3& T, StateReader& reader) {
  reader.get(T.q.coeffs());
  reader.get(T.p);
}

/// A class that lists its members: `static void members(auto& self, auto& archive) { archive(self.a, self.b); }`.
template <class T, class Archive>
concept NamesMembers = requires(T& value, Archive& archive) {
  T::members(value, archive);
};

class SavingArchive {
 public:
  explicit SavingArchive(StateWriter& writer) : writer_(writer) {}

  template <class... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }

 private:
  template <class T>
  void put(const T& value) {
    if constexpr (NamesMembers<T, SavingArchive>) {
      T::members(value, *this);
    } else if constexpr (requires { value.save(writer_); }) {
      value.save(writer_);
    } else {
      writer_.put(value);
    }
  }
  void put(const SE3& T) { put_pose(T, writer_); }
  template <class T>
  void put(const std::optional<T>& value) {
    writer_.put(value.has_value());
    if (value) put(*value);
  }
  template <class K, class T>
  void put(const std::map<K, T>& items) {
    writer_.put(static_cast<int64_t>(items.size()));
    for (const auto& [key, value] : items) {
      put(key);
      put(value);
    }
  }
  template <class T>
  void put(const std::vector<T>& items) {
    put_list(items);
  }
  template <class T>
  void put(const std::deque<T>& items) {
    put_list(items);
  }
  template <class List>
  void put_list(const List& items) {
    writer_.put(static_cast<int64_t>(items.size()));
    for (const auto& item : items) put(item);
  }

  StateWriter& writer_;
};

class LoadingArchive {
 public:
  explicit LoadingArchive(StateReader& reader) : reader_(reader) {}

  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }

 private:
  template <class T>
  void get(T& value) {
    if constexpr (NamesMembers<T, LoadingArchive>) {
      T::members(value, *this);
    } else if constexpr (requires { value.load(reader_); }) {
      value.load(reader_);
    } else {
      reader_.get(value);
    }
  }
  void get(SE3& T) { get_pose(T, reader_); }
  template <class T>
  void get(std::optional<T>& value) {
    value.reset();
    if (reader_.get<bool>()) get(value.emplace());
  }
  template <class K, class T>
  void get(std::map<K, T>& items) {
    items.clear();
    for (auto left = reader_.get<int64_t>(); left > 0; --left) {
      const K key = reader_.get<K>();
      get(items[key]);
    }
  }
  template <class T>
  void get(std::vector<T>& items) {
    get_list(items);
  }
  template <class T>
  void get(std::deque<T>& items) {
    get_list(items);
  }
  template <class List>
  void get_list(List& items) {
    items.clear();
    for (auto left = reader_.get<int64_t>(); left > 0; --left) get(items.emplace_back());
  }

  StateReader& reader_;
};

}  // namespace roadfix
