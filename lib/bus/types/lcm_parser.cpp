#include "bus/types/lcm_parser.h"

#include <cctype>
#include <map>

namespace roadfix {

namespace {

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.'; }

/// Words and single punctuation marks, comments left out.
std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> tokens;
  for (std::size_t i = 0; i < text.size();) {
    if (text.compare(i, 2, "//") == 0) {
      i = std::min(text.find('\n', i), text.size());
    } else if (text.compare(i, 2, "/*") == 0) {
      const std::size_t end = text.find("*/", i + 2);
      i = end == std::string::npos ? text.size() : end + 2;
    } else if (std::isspace(static_cast<unsigned char>(text[i])) != 0) {
      ++i;
    } else if (is_word(text[i])) {
      std::size_t end = i;
      while (end < text.size() && is_word(text[end])) ++end;
      tokens.push_back(text.substr(i, end - i));
      i = end;
    } else {
      tokens.emplace_back(1, text[i++]);
    }
  }
  return tokens;
}

class Parser {
 public:
  Parser(std::string where, const std::string& text) : where_(std::move(where)), tokens_(split(text)) {}

  SchemaType parse() {
    if (peek() == "package") {
      take();
      take();
      expect(";");
    }
    expect("struct");
    type_.name = take();
    expect("{");
    while (peek() != "}") {
      if (peek() == "const") {
        while (take() != ";") {
        }
      } else {
        parse_fields();
      }
    }
    expect("}");
    if (position_ != tokens_.size()) fail("one struct per file, but then comes '" + peek() + "'");
    if (type_.fields.empty()) fail("a struct without fields");
    return type_;
  }

 private:
  /// type name[dims], name[dims];
  void parse_fields() {
    std::string type = take();
    if (const std::size_t dot = type.rfind('.'); dot != std::string::npos) type = type.substr(dot + 1);
    do {
      SchemaField field{type, take(), {}};
      while (peek() == "[") {
        take();
        field.dims.push_back(parse_dim());
        expect("]");
      }
      type_.fields.push_back(field);
    } while (take_if(","));
    expect(";");
  }

  SchemaDim parse_dim() {
    SchemaDim dim{take(), 0, -1};
    if (std::isdigit(static_cast<unsigned char>(dim.text[0])) != 0) {
      dim.fixed = std::stoll(dim.text);
      return dim;
    }
    for (std::size_t i = 0; i < type_.fields.size(); ++i) {
      const SchemaField& field = type_.fields[i];
      if (field.name == dim.text && field.dims.empty() && field.type.starts_with("int"))
        dim.field = static_cast<int>(i);
    }
    if (dim.field < 0) fail("the size '" + dim.text + "' is no earlier integer field");
    return dim;
  }

  [[nodiscard]] std::string peek() const { return position_ < tokens_.size() ? tokens_[position_] : std::string(); }
  std::string take() {
    if (position_ >= tokens_.size()) fail("ends too early");
    return tokens_[position_++];
  }
  bool take_if(const std::string& token) {
    if (peek() != token) return false;
    ++position_;
    return true;
  }
  void expect(const std::string& token) {
    if (!take_if(token)) fail("expected '" + token + "', found '" + peek() + "'");
  }
  [[noreturn]] void fail(const std::string& what) const { throw SchemaError("type " + where_ + ": " + what); }

  std::string where_;
  std::vector<std::string> tokens_;
  std::size_t position_ = 0;
  SchemaType type_;
};

}  // namespace

int primitive_bytes(const std::string& type) {
  static const std::map<std::string, int> kBytes = {{"int8_t", 1}, {"int16_t", 2}, {"int32_t", 4}, {"int64_t", 8},
                                                    {"byte", 1},   {"boolean", 1}, {"float", 4},   {"double", 8}};
  const auto found = kBytes.find(type);
  return found == kBytes.end() ? 0 : found->second;
}

bool is_primitive(const std::string& type) { return type == "string" || primitive_bytes(type) > 0; }

SchemaType parse_lcm_type(const std::string& where, const std::string& text) { return Parser(where, text).parse(); }

}  // namespace roadfix
