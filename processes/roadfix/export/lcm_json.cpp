#include "roadfix/export/lcm_json.h"

#include <bit>
#include <charconv>
#include <cmath>

namespace roadfix {
namespace {

/// By the number of following bytes that its leading bytes declare.
bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto code = static_cast<unsigned char>(text[i]);
    if (code < 0x80) continue;
    const int following = code >= 0xf0 && code < 0xf5 ? 3 : code >= 0xe0 && code < 0xf0 ? 2 : code >= 0xc2 ? 1 : 0;
    if (following == 0 || code >= 0xf5 || i + static_cast<std::size_t>(following) >= text.size()) return false;
    for (int k = 0; k < following; ++k) {
      if ((static_cast<unsigned char>(text[++i]) & 0xc0U) != 0x80U) return false;
    }
  }
  return true;
}

/// What is no UTF-8 is taken for Latin-1, so that it is JSON all the same.
void append_quoted(std::string_view text, std::string& out) {
  constexpr char kHex[] = "0123456789abcdef";
  const bool utf8 = is_utf8(text);
  out += '"';
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (code < 0x20 || code == 0x7f || (code > 0x7f && !utf8)) {
      out += "\\u00";
      out += kHex[code >> 4U];
      out += kHex[code & 15U];
    } else {
      out += c;
    }
  }
  out += '"';
}

void append_base64(std::span<const uint8_t> bytes, std::string& out) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  out += '"';
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    const uint32_t group = (uint32_t{bytes[i]} << 16U) | (left > 1 ? uint32_t{bytes[i + 1]} << 8U : 0U) |
                           (left > 2 ? uint32_t{bytes[i + 2]} : 0U);
    out += kDigits[group >> 18U];
    out += kDigits[(group >> 12U) & 63U];
    out += left > 1 ? kDigits[(group >> 6U) & 63U] : '=';
    out += left > 2 ? kDigits[group & 63U] : '=';
  }
  out += '"';
}

template <class Number>
void append_number(Number value, std::string& out) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value);
  out.append(text, end.ptr);
}

template <class Real>
void append_real(Real value, std::string& out) {
  if (std::isfinite(value)) {
    append_number(value, out);
  } else {
    out += "null";
  }
}

bool is_hash(const SchemaField& field) {
  return field.type == "int64_t" && (field.name == "digest" || field.name == "config_hash");
}

}  // namespace

struct LcmJson::Cursor {
  std::span<const uint8_t> rest;
  std::string& out;

  uint64_t take(int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; ++i) value = (value << 8U) | rest[static_cast<std::size_t>(i)];
    rest = rest.subspan(static_cast<std::size_t>(size));
    return value;
  }
  int64_t take_signed(int size) {
    const int unused = 64 - 8 * size;
    return static_cast<int64_t>(take(size) << unused) >> unused;
  }
};

LcmJson::LcmJson(const Schema& schema, const std::string& type, bool leave_out_bytes) {
  main_ = compile(schema, schema.type(type), leave_out_bytes, schema_text_);
}

std::size_t LcmJson::compile(const Schema& schema, const SchemaType& type, bool leave_out_bytes, std::string& text) {
  Program program;
  text += R"({"title":"roadfix.)" + type.name + R"(","type":"object","properties":{)";
  bool first = true;
  std::vector<int> count_of(type.fields.size(), -1);
  for (std::size_t i = 0; i < type.fields.size(); ++i) {
    const SchemaField& field = type.fields[i];
    Step step;
    step.size = primitive_bytes(field.type);
    std::string one = R"({"type":"integer"})";
    if (field.type == "double" || field.type == "float") {
      step.kind = field.type == "double" ? Kind::kDouble : Kind::kFloat;
      one = R"({"type":"number"})";
    } else if (field.type == "string") {
      step.kind = Kind::kText;
      one = R"({"type":"string"})";
    } else if (field.type == "boolean") {
      step.kind = Kind::kBoolean;
      one = R"({"type":"boolean"})";
    } else if (is_hash(field)) {
      step.kind = Kind::kHash;
      one = R"({"type":"string"})";
    } else if (field.type == "byte" && !field.dims.empty()) {
      step.kind = Kind::kBytes;
      one = R"({"type":"string","contentEncoding":"base64"})";
    } else if (step.size == 0) {
      step.kind = Kind::kStruct;
      one.clear();
      step.program = compile(schema, schema.type(field.type), leave_out_bytes, one);
    }
    for (const SchemaDim& dim : field.dims) {
      int index = -1;
      if (dim.field >= 0) {
        int& count = count_of[static_cast<std::size_t>(dim.field)];
        if (count < 0) {
          count = program.counts++;
          program.steps[static_cast<std::size_t>(dim.field)].count = count;
        }
        index = count;
      }
      step.sizes.emplace_back(index, dim.fixed);
    }
    const std::size_t arrays = field.dims.size() - (step.kind == Kind::kBytes ? 1 : 0);
    for (std::size_t k = 0; k < arrays; ++k) one = R"({"type":"array","items":)" + one + "}";
    step.left_out = step.kind == Kind::kBytes && leave_out_bytes;
    if (!step.left_out) {
      step.key = std::string(first ? "" : ",") + "\"" + field.name + "\":";
      text += step.key + one;
      first = false;
    }
    program.steps.push_back(step);
  }
  text += "}}";
  programs_.push_back(std::move(program));
  return programs_.size() - 1;
}

void LcmJson::write(std::span<const uint8_t> bytes, std::string& out) const {
  Cursor cursor{bytes.subspan(8), out};
  write_struct(programs_[main_], cursor);
}

void LcmJson::write_struct(const Program& program, Cursor& cursor) const {
  std::vector<int64_t> counts(static_cast<std::size_t>(program.counts));
  std::vector<int64_t> sizes;
  cursor.out += '{';
  for (const Step& step : program.steps) {
    cursor.out += step.key;
    if (step.count >= 0) {
      const int64_t value = cursor.take_signed(step.size);
      counts[static_cast<std::size_t>(step.count)] = value;
      append_number(value, cursor.out);
      continue;
    }
    sizes.clear();
    for (const auto& [count, fixed] : step.sizes) {
      sizes.push_back(count >= 0 ? counts[static_cast<std::size_t>(count)] : fixed);
    }
    write_array(step, sizes, 0, cursor);
  }
  cursor.out += '}';
}

void LcmJson::write_array(const Step& step, const std::vector<int64_t>& sizes, std::size_t level,
                          Cursor& cursor) const {
  if (level == sizes.size()) return write_one(step, cursor);
  if (step.kind == Kind::kBytes && level + 1 == sizes.size()) {
    const auto size = static_cast<std::size_t>(sizes[level]);
    if (!step.left_out) append_base64(cursor.rest.first(size), cursor.out);
    cursor.rest = cursor.rest.subspan(size);
    return;
  }
  cursor.out += '[';
  for (int64_t i = 0; i < sizes[level]; ++i) {
    if (i > 0) cursor.out += ',';
    write_array(step, sizes, level + 1, cursor);
  }
  cursor.out += ']';
}

void LcmJson::write_one(const Step& step, Cursor& cursor) const {
  std::string& out = cursor.out;
  switch (step.kind) {
    case Kind::kInteger:
      return append_number(cursor.take_signed(step.size), out);
    case Kind::kHash:
      out += '"';
      append_number(cursor.take_signed(step.size), out);
      out += '"';
      return;
    case Kind::kBoolean:
      out += cursor.take(1) != 0 ? "true" : "false";
      return;
    case Kind::kFloat:
      return append_real(std::bit_cast<float>(static_cast<uint32_t>(cursor.take(4))), out);
    case Kind::kDouble:
      return append_real(std::bit_cast<double>(cursor.take(8)), out);
    case Kind::kText: {
      const auto size = static_cast<std::size_t>(cursor.take(4));  // with its final zero
      append_quoted({reinterpret_cast<const char*>(cursor.rest.data()), size - 1}, out);
      cursor.rest = cursor.rest.subspan(size);
      return;
    }
    case Kind::kBytes:
      return append_number(cursor.take(1), out);
    case Kind::kStruct:
      return write_struct(programs_[step.program], cursor);
  }
}

}  // namespace roadfix
