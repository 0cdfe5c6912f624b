#include "bus/types/type_conversion.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "bus/types/message.h"

namespace roadfix {

namespace {

using Bytes = std::span<const uint8_t>;

uint64_t read_raw(const uint8_t* data, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value = (value << 8U) | data[i];
  return value;
}

int64_t read_integer(const uint8_t* data, int bytes) {
  const int unused_bits = 64 - 8 * bytes;
  return static_cast<int64_t>(read_raw(data, bytes) << unused_bits) >> unused_bits;
}

double read_number(const std::string& type, const uint8_t* data) {
  const int bytes = primitive_bytes(type);
  if (type == "double") return std::bit_cast<double>(read_raw(data, bytes));
  if (type == "float") return static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(read_raw(data, bytes))));
  return static_cast<double>(read_integer(data, bytes));
}

void put_raw(uint64_t value, int bytes, std::vector<uint8_t>& out) {
  for (int i = bytes - 1; i >= 0; --i) out.push_back(static_cast<uint8_t>(value >> (8U * static_cast<unsigned>(i))));
}

void put_number(const std::string& type, double value, std::vector<uint8_t>& out) {
  const int bytes = primitive_bytes(type);
  if (type == "double") return put_raw(std::bit_cast<uint64_t>(value), bytes, out);
  if (type == "float") return put_raw(std::bit_cast<uint32_t>(static_cast<float>(value)), bytes, out);
  put_raw(static_cast<uint64_t>(std::llround(value)), bytes, out);
}

bool is_integer(const std::string& type) { return primitive_bytes(type) > 0 && type != "double" && type != "float"; }

const SchemaField* field_of(const SchemaType& type, const std::string& name) {
  const auto found =
      std::find_if(type.fields.begin(), type.fields.end(), [&](const SchemaField& f) { return f.name == name; });
  return found == type.fields.end() ? nullptr : &*found;
}

const FieldRule* rule_for(const TypeRule* rule, const std::string& field) {
  if (rule == nullptr) return nullptr;
  const auto found =
      std::find_if(rule->fields.begin(), rule->fields.end(), [&](const FieldRule& f) { return f.field == field; });
  return found == rule->fields.end() ? nullptr : &*found;
}

bool same_dims(const SchemaField& a, const SchemaField& b) {
  return std::equal(a.dims.begin(), a.dims.end(), b.dims.begin(), b.dims.end(),
                    [](const SchemaDim& x, const SchemaDim& y) { return x.text == y.text; });
}

/// What one struct of a message holds: each field's bytes.
struct Parsed {
  std::map<std::string, Bytes> fields;
  std::map<std::string, int64_t> counts;  ///< of its integer fields
};

/// Takes a checked message apart; the bytes are known to suffice.
class Taker {
 public:
  Taker(const Schema& schema, Bytes rest) : schema_(schema), rest_(rest) {}

  Parsed take(const SchemaType& type) {
    Parsed out;
    for (const SchemaField& field : type.fields) {
      int64_t elements = 1;
      for (const SchemaDim& dim : field.dims) elements *= dim.field >= 0 ? out.counts.at(dim.text) : dim.fixed;
      const Bytes before = rest_;
      for (int64_t i = 0; i < elements; ++i) skip_one(field.type);
      const Bytes bytes = before.first(before.size() - rest_.size());
      out.fields[field.name] = bytes;
      if (field.dims.empty() && is_integer(field.type)) {
        out.counts[field.name] = read_integer(bytes.data(), primitive_bytes(field.type));
      }
    }
    return out;
  }

 private:
  void skip_one(const std::string& type) {
    if (type == "string") {
      rest_ = rest_.subspan(4 + static_cast<std::size_t>(read_integer(rest_.data(), 4)));
    } else if (const int bytes = primitive_bytes(type); bytes > 0) {
      rest_ = rest_.subspan(static_cast<std::size_t>(bytes));
    } else {
      static_cast<void>(take(schema_.type(type)));
    }
  }

  const Schema& schema_;
  Bytes rest_;

 public:
  [[nodiscard]] Bytes rest() const { return rest_; }
};

}  // namespace

/// Writes one new struct from an old one.
class TypeConverter::Writer {
 public:
  Writer(const TypeConverter& converter, const Schema& old, const std::string& version)
      : converter_(converter), old_(old), version_(version) {}

  /// Returns what of `bytes` is behind the old struct.
  Bytes write(const SchemaType& from, const SchemaType& to, Bytes bytes, std::vector<uint8_t>& out) const {
    Taker taker(old_, bytes);
    const Parsed parsed = taker.take(from);
    const TypeRule* rule = converter_.rule_of(version_, from.name);
    std::map<std::string, int64_t> counts;
    for (const SchemaField& field : to.fields) {
      int64_t elements = 1;
      for (const SchemaDim& dim : field.dims) elements *= dim.field >= 0 ? counts.at(dim.text) : dim.fixed;
      const std::size_t begin = out.size();
      write_field(from, parsed, field, rule_for(rule, field.name), elements, out);
      if (field.dims.empty() && is_integer(field.type)) {
        counts[field.name] = read_integer(out.data() + begin, primitive_bytes(field.type));
      }
    }
    return taker.rest();
  }

 private:
  void write_field(const SchemaType& from, const Parsed& parsed, const SchemaField& field, const FieldRule* rule,
                   int64_t elements, std::vector<uint8_t>& out) const {
    if (rule != nullptr && rule->from.empty()) {
      for (int64_t i = 0; i < elements; ++i) write_value(field.type, rule->value, out);
      return;
    }
    const SchemaField& source = *field_of(from, rule != nullptr ? rule->from : field.name);
    Bytes bytes = parsed.fields.at(source.name);
    if (is_primitive(field.type) && field.type == source.type) {
      out.insert(out.end(), bytes.begin(), bytes.end());
    } else if (is_primitive(field.type)) {
      const auto step = static_cast<std::size_t>(primitive_bytes(source.type));
      for (; !bytes.empty(); bytes = bytes.subspan(step)) write_number(source.type, bytes, field.type, out);
    } else {
      const SchemaType& inner = converter_.current_->type(field.type);
      for (int64_t i = 0; i < elements; ++i) bytes = write(old_.type(source.type), inner, bytes, out);
    }
  }

  static void write_number(const std::string& from, Bytes bytes, const std::string& to, std::vector<uint8_t>& out) {
    if (is_integer(from) && is_integer(to)) {  // a double would round what needs more than 53 bits
      return put_raw(static_cast<uint64_t>(read_integer(bytes.data(), primitive_bytes(from))), primitive_bytes(to),
                     out);
    }
    put_number(to, read_number(from, bytes.data()), out);
  }

  static void write_value(const std::string& type, double value, std::vector<uint8_t>& out) {
    if (type != "string") return put_number(type, value, out);
    put_raw(1, 4, out);
    out.push_back(0);
  }

  const TypeConverter& converter_;
  const Schema& old_;
  const std::string& version_;
};

TypeConverter::TypeConverter(const std::vector<ReleasedTypes>& released, const Schema& current,
                             const std::vector<TypeRule>& rules)
    : current_(&current) {
  for (const ReleasedTypes& types : released) schemas_.emplace(types.version, Schema(types.texts));
  for (const TypeRule& rule : rules) {
    const auto schema = schemas_.find(rule.version);
    if (schema == schemas_.end()) throw SchemaError("types of version " + rule.version + ": not there");
    const Schema& old = schema->second;
    if (!entries_.emplace(old.fingerprint(rule.from), Entry{rule, &old, old.check_of(rule.from)}).second) {
      throw SchemaError("type " + rule.from + " of " + rule.version + ": two rules");
    }
  }
  for (const auto& [fingerprint, entry] : entries_) require_complete(entry);
}

const TypeConverter& TypeConverter::built_in() {
  static const TypeConverter kConverter(released_types(), Schema::built_in(), released_rules());
  return kConverter;
}

const TypeRule* TypeConverter::rule_of(const std::string& version, const std::string& type) const {
  for (const auto& [fingerprint, entry] : entries_) {
    if (entry.rule.version == version && entry.rule.from == type) return &entry.rule;
  }
  return nullptr;
}

void TypeConverter::require_complete(const Entry& entry) const {
  const SchemaType& from = entry.old->type(entry.rule.from);
  const SchemaType& to = current_->type(entry.rule.to);
  const auto fail = [&](const std::string& field, const std::string& what) {
    throw SchemaError("conversion of " + from.name + " of " + entry.rule.version + " to " + to.name + ": " + field +
                      " " + what);
  };
  for (const FieldRule& rule : entry.rule.fields) {
    if (field_of(to, rule.field) == nullptr) fail(rule.field, "is no field of the new type");
    if (!rule.from.empty() && field_of(from, rule.from) == nullptr) fail(rule.from, "is no field of the old type");
  }
  for (const SchemaField& field : to.fields) {
    const FieldRule* rule = rule_for(&entry.rule, field.name);
    if (rule != nullptr && rule->from.empty()) {
      if (!is_primitive(field.type)) fail(field.name, "is a struct, which a number cannot fill");
      continue;
    }
    const SchemaField* source = field_of(from, rule != nullptr ? rule->from : field.name);
    if (source == nullptr) fail(field.name, "is new, and no rule says what it holds");
    if (!same_dims(field, *source)) fail(field.name, "has another size");
    const bool numbers = primitive_bytes(field.type) > 0 && primitive_bytes(source->type) > 0;
    const bool structs = !is_primitive(field.type) && !is_primitive(source->type);
    if (structs && field.type != source->type) {
      const TypeRule* inner = rule_of(entry.rule.version, source->type);
      if (inner == nullptr || inner->to != field.type) fail(field.name, "has another type, which no rule converts");
    } else if (!numbers && !structs && field.type != source->type) {
      fail(field.name, "has another type");
    }
    if (structs && field.type == source->type && rule_of(entry.rule.version, source->type) == nullptr &&
        entry.old->fingerprint(source->type) != current_->fingerprint(field.type)) {
      fail(field.name, "is of a type that was changed without a new name");
    }
  }
}

TypeConverter::Result TypeConverter::operator()(std::span<const uint8_t> message, std::vector<uint8_t>& out) const {
  if (message.size() < 8) return Result::kCurrent;
  const auto found = entries_.find(read_int64(message.data()));
  if (found == entries_.end()) return Result::kCurrent;
  const Entry& entry = found->second;
  if (entry.check(message) != CheckResult::kOk) return Result::kBroken;
  out.clear();
  put_raw(static_cast<uint64_t>(current_->fingerprint(entry.rule.to)), 8, out);
  const Writer writer(*this, *entry.old, entry.rule.version);
  writer.write(entry.old->type(entry.rule.from), current_->type(entry.rule.to), message.subspan(8), out);
  return Result::kConverted;
}

std::optional<std::string> TypeConverter::old_name(int64_t fingerprint) const {
  const auto found = entries_.find(fingerprint);
  if (found == entries_.end()) return std::nullopt;
  return found->second.rule.from + " of " + found->second.rule.version;
}

}  // namespace roadfix
