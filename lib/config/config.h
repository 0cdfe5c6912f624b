/// Strict YAML configuration, both ways. A struct with in-class defaults lists its keys once, in a visit() found by
/// argument-dependent lookup; units are part of the keys, and the library that owns the struct needs no YAML:
///
/// ```
///   template <class Visitor>
///   void visit(WheelConfig& c, Visitor& v) {
///     v.number("gyro_noise_radps_per_rthz", c.gyro_noise, 1e-7, 1.0);       // key, value, min, max
///     v.integer("window", c.window, 1, 1000);
///     v.boolean("use_mag", c.use_mag);
///     v.choice("mode", c.mode, {{"klt", Mode::kKlt}, {"orb", Mode::kOrb}});
///     v.vector("lever_arm_m", c.lever_arm, -20.0, 20.0);                    // fixed Eigen vectors and matrices
///     v.text("name", c.name);
///     v.optional_number("x_m", c.x, lo, hi);                                // std::optional<double>; likewise
///                                                                           // optional_integer, _boolean, _text,
///                                                                           // _choice, _vector, _group
///     v.numbers("weights", c.weights, lo, hi);                              // std::vector; integers, texts, choices
///     v.group("gate", c.gate);                                              // a nested struct
///     v.groups("windows", c.windows);                                       // std::vector of nested structs
///     v.require("name");                                                    // all other keys are optional
///     v.check("q_wxyz", is_unit(c.q), "must have unit norm");               // conditions that are not a range
///   }
/// ```
///
/// Reading refuses, with file, line, key path, value and allowed range (ConfigError): an unknown key (naming the one
/// that was probably meant, a wrong unit suffix first), a missing required key, a wrong type, NaN, a value out of
/// range, a duplicate key. Writing gives the effective values, defaults included; read back they are the same bits.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "config/config_error.h"
#include "config/yaml_node.h"
#include "config/yaml_reader.h"
#include "config/yaml_writer.h"

namespace roadfix {

/// `config` with the values of `text`; `file` is what errors call it.
template <class T>
T parse_config(const std::string& text, const std::string& file, T config = T{}) {
  const YamlNode root = parse_yaml_tree(text, file);
  if (root.kind != YamlNode::Kind::kMap) throw ConfigError(file, root.line, "must be a map of keys and values");
  YamlReader reader(root, file, "");
  visit(config, reader);
  reader.finish();
  return config;
}

template <class T>
T load_config(const std::filesystem::path& path, T config = T{}) {
  return parse_config<T>(read_text_file(path), path.string(), std::move(config));
}

/// A process's tuning, DIR/PROCESS.yaml: an absent file means the defaults.
template <class T>
T load_config_or_defaults(const std::filesystem::path& path, T config = T{}) {
  return std::filesystem::exists(path) ? load_config<T>(path, std::move(config)) : config;
}

/// The effective values as YAML.
template <class T>
std::string config_text(T config) {
  YamlWriter writer;
  visit(config, writer);
  return writer.text();
}

/// The same for a person: behind each choice stands what else it could be (--print-config).
template <class T>
std::string explained_config_text(T config) {
  YamlWriter writer(YamlWriter::Alternatives::kNamed);
  visit(config, writer);
  return writer.text();
}

}  // namespace roadfix
