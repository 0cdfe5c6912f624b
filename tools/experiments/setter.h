/// Configuration keys from a command line's KEY=VALUE.
#pragma once

#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>

namespace roadfix::bench {

/// Sets one configuration key from text, in whatever group it stands.
struct Setter {
  std::string key, text;
  bool done = false;
  void number(const char* name, double& x, double, double) {
    if (name == key) x = std::stod(text), done = true;
  }
  void integer(const char* name, int& x, int, int) {
    if (name == key) x = std::stoi(text), done = true;
  }
  void boolean(const char* name, bool& x) {
    if (name == key) x = text == "true", done = true;
  }
  template <class T>
  void choice(const char* name, T& x, std::initializer_list<std::pair<const char*, T>> values) {
    for (const auto& [word, value] : values) {
      if (name == key && text == word) x = value, done = true;
    }
  }
  template <class T>
  void group(const char*, T& x) {
    visit(x, *this);
  }
  void check(const char* name, bool ok, const std::string& what) const {
    if (name == key && !ok) throw std::runtime_error(key + " = " + text + " " + what);
  }
};

/// Sets the key that `text`, KEY=VALUE, names; throws where there is none.
template <class Config>
void set_key(Config& config, const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos) throw std::runtime_error("no KEY=VALUE: " + text);
  Setter setter{text.substr(0, equals), text.substr(equals + 1)};
  visit(config, setter);
  if (!setter.done) throw std::runtime_error("unknown key " + text);
}

}  // namespace roadfix::bench
