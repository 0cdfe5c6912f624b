#include "bus/types/schema.h"

#include <algorithm>

#include "bus/types/message.h"

namespace roadfix {

namespace {

int64_t hash_update(int64_t hash, int value) {
  return static_cast<int64_t>((static_cast<uint64_t>(hash) << 8) ^ static_cast<uint64_t>(hash >> 55)) + value;
}

int64_t hash_update(int64_t hash, const std::string& text) {
  hash = hash_update(hash, static_cast<int>(text.size()));
  for (const char c : text) hash = hash_update(hash, c);
  return hash;
}

/// lcm-gen's hash of one struct without its nested types (lcmgen.c, lcm_struct_hash); checked against the generated
/// classes by a test.
int64_t own_hash(const SchemaType& type) {
  int64_t hash = 0x12345678;
  for (const SchemaField& field : type.fields) {
    hash = hash_update(hash, field.name);
    if (is_primitive(field.type)) hash = hash_update(hash, field.type);
    hash = hash_update(hash, static_cast<int>(field.dims.size()));
    for (const SchemaDim& dim : field.dims) {
      hash = hash_update(hash, dim.field >= 0 ? 1 : 0);
      hash = hash_update(hash, dim.text);
    }
  }
  return hash;
}

}  // namespace

Schema::Schema(const std::vector<TypeText>& texts) {
  for (const TypeText& text : texts) {
    const SchemaType type = parse_lcm_type(text.name, text.text);
    if (!types_.emplace(type.name, type).second) throw SchemaError("type " + type.name + ": defined twice");
  }
  for (const auto& [name, type] : types_) static_cast<void>(check_of(name));
}

const Schema& Schema::built_in() {
  static const Schema kSchema(type_texts());
  return kSchema;
}

const SchemaType& Schema::type(const std::string& name) const {
  const auto found = types_.find(name);
  if (found == types_.end()) throw SchemaError("type " + name + ": unknown");
  return found->second;
}

int64_t Schema::fingerprint(const std::string& name) const {
  std::vector<std::string> parents;
  return static_cast<int64_t>(nested_hash(type(name), parents));
}

uint64_t Schema::nested_hash(const SchemaType& type, std::vector<std::string>& parents) const {
  if (std::find(parents.begin(), parents.end(), type.name) != parents.end()) return 0;
  parents.push_back(type.name);
  auto hash = static_cast<uint64_t>(own_hash(type));
  for (const SchemaField& field : type.fields) {
    if (!is_primitive(field.type)) hash += nested_hash(this->type(field.type), parents);
  }
  parents.pop_back();
  return (hash << 1) + ((hash >> 63) & 1);
}

std::optional<std::string> Schema::name_of(int64_t fingerprint) const {
  for (const auto& [name, type] : types_) {
    if (this->fingerprint(name) == fingerprint) return name;
  }
  return std::nullopt;
}

/// Turns a type and what is nested in it into programs.
struct Schema::Compiler {
  using Step = MessageCheck::Step;
  using Kind = MessageCheck::Kind;

  const Schema& schema;
  MessageCheck& check;
  std::vector<std::string> parents = {};

  void compile(const SchemaType& type, std::size_t program, int& counts) {
    if (std::find(parents.begin(), parents.end(), type.name) != parents.end()) {
      throw SchemaError("type " + type.name + ": contains itself");
    }
    parents.push_back(type.name);
    std::vector<int> count_of_field(type.fields.size(), -1);
    for (const SchemaField& field : type.fields) {
      for (const SchemaDim& dim : field.dims) {
        if (dim.field >= 0) count_of_field[static_cast<std::size_t>(dim.field)] = 0;
      }
    }
    for (std::size_t i = 0; i < type.fields.size(); ++i) {
      if (count_of_field[i] == 0) {
        if (counts == MessageCheck::kMaxCounts) throw SchemaError("type " + type.name + ": too many counts");
        count_of_field[i] = counts++;
        check.programs_[program].push_back({Kind::kCount, primitive_bytes(type.fields[i].type), count_of_field[i]});
      } else {
        compile_field(type, type.fields[i], count_of_field, program, counts);
      }
    }
    parents.pop_back();
  }

  void compile_field(const SchemaType& type, const SchemaField& field, const std::vector<int>& count_of_field,
                     std::size_t program, int& counts) {
    Step step{Kind::kElements, primitive_bytes(field.type)};
    std::size_t used = 0;
    for (const SchemaDim& dim : field.dims) {
      if (dim.field < 0) {
        step.fixed *= dim.fixed;
      } else if (used < step.sizes.size()) {
        step.sizes[used++] = count_of_field[static_cast<std::size_t>(dim.field)];
      } else {
        throw SchemaError("type " + type.name + ": " + field.name + " has too many sizes");
      }
    }
    std::vector<Step>& steps = check.programs_[program];
    if (field.type == "string") {
      step.kind = Kind::kStrings;
      steps.push_back(step);
    } else if (step.bytes == 0 && field.dims.empty()) {
      compile(schema.type(field.type), program, counts);
    } else if (step.bytes == 0) {
      step.kind = Kind::kStructs;
      step.program = static_cast<int>(check.programs_.size());
      steps.push_back(step);
      check.programs_.emplace_back();
      int nested_counts = 0;
      compile(schema.type(field.type), check.programs_.size() - 1, nested_counts);
    } else if (used > 0) {
      steps.push_back(step);
    } else if (!steps.empty() && steps.back().kind == Kind::kSkip) {
      steps.back().bytes += step.bytes * step.fixed;
    } else {
      steps.push_back({Kind::kSkip, step.bytes * step.fixed});
    }
  }
};

MessageCheck Schema::check_of(const std::string& name) const {
  MessageCheck check;
  check.fingerprint_ = fingerprint(name);
  check.programs_.emplace_back();
  int counts = 0;
  Compiler{*this, check}.compile(type(name), 0, counts);
  return check;
}

}  // namespace roadfix
