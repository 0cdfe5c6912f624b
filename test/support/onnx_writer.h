/// Small ONNX files for tests: the messages of onnx.proto (ONNX IR version 7) that a few layers need, written by hand.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace roadfix::test {

/// Protocol Buffers' wire format: fields in the order in which they are added.
class ProtoWriter {
 public:
  ProtoWriter& integer(int field, int64_t value) {
    varint(static_cast<uint64_t>(field) << 3U);
    varint(static_cast<uint64_t>(value));
    return *this;
  }
  ProtoWriter& bytes(int field, const std::string& value) {
    varint((static_cast<uint64_t>(field) << 3U) | 2U);
    varint(value.size());
    out_ += value;
    return *this;
  }
  ProtoWriter& message(int field, const ProtoWriter& value) { return bytes(field, value.out_); }
  [[nodiscard]] const std::string& text() const { return out_; }

 private:
  void varint(uint64_t value) {
    for (; value >= 0x80U; value >>= 7U) out_.push_back(static_cast<char>((value & 0x7FU) | 0x80U));
    out_.push_back(static_cast<char>(value));
  }
  std::string out_;
};

class OnnxWriter {
 public:
  /// The input "x", 1 x channels x 64 x 64; the engine takes other sizes too.
  explicit OnnxWriter(int channels) : channels_(channels) {
    graph_.bytes(2, "test");
    graph_.message(11, value_info("x", {1, channels, 64, 64}));
  }

  /// `weights` are of the first input channel: out x size x size; those of the others are zero.
  std::string conv(const std::string& in, int out, int size, int stride, int pad, const std::vector<float>& weights,
                   const std::vector<float>& bias) {
    const std::string name = next("conv");
    std::vector<float> all;
    const auto patch = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
    for (int k = 0; k < out; ++k) {
      const auto begin = weights.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(k) * patch);
      all.insert(all.end(), begin, begin + static_cast<std::ptrdiff_t>(patch));
      all.insert(all.end(), static_cast<std::size_t>(channels_ - 1) * patch, 0.0F);
    }
    tensor(name + "_w", {out, channels_, size, size}, all);
    tensor(name + "_b", {out}, bias);
    ProtoWriter node = begin_node("Conv", {in, name + "_w", name + "_b"}, name);
    node.message(5, ints("kernel_shape", {size, size}));
    node.message(5, ints("strides", {stride, stride}));
    node.message(5, ints("pads", {pad, pad, pad, pad}));
    graph_.message(1, node);
    return name;
  }

  std::string layer(const std::string& type, const std::string& in) {
    const std::string name = next(type);
    graph_.message(1, begin_node(type, {in}, name));
    return name;
  }

  std::string reshape(const std::string& in, const std::vector<int64_t>& shape) {
    const std::string name = next("reshape");
    ProtoWriter t;
    t.integer(1, static_cast<int64_t>(shape.size())).integer(2, 7).bytes(8, name + "_shape");
    t.bytes(9, raw(shape));
    graph_.message(5, t);
    graph_.message(1, begin_node("Reshape", {in, name + "_shape"}, name));
    return name;
  }

  void output(const std::string& name, const std::vector<int64_t>& shape) {
    graph_.message(12, value_info(name, shape));
  }

  [[nodiscard]] std::vector<uint8_t> file() const {
    ProtoWriter model, opset;
    opset.bytes(1, "").integer(2, 11);
    model.integer(1, 7).bytes(2, "roadfix test").message(7, graph_).message(8, opset);
    return {model.text().begin(), model.text().end()};
  }

 private:
  template <class T>
  static std::string raw(const std::vector<T>& values) {
    std::string out(values.size() * sizeof(T), '\0');
    std::memcpy(out.data(), values.data(), out.size());
    return out;
  }
  static ProtoWriter value_info(const std::string& name, const std::vector<int64_t>& shape) {
    ProtoWriter dims, tensor, type, info;
    for (const int64_t size : shape) dims.message(1, ProtoWriter().integer(1, size));
    tensor.integer(1, 1).message(2, dims);
    type.message(1, tensor);
    return info.bytes(1, name).message(2, type);
  }
  static ProtoWriter ints(const std::string& name, const std::vector<int64_t>& values) {
    ProtoWriter attribute;
    attribute.bytes(1, name);
    for (const int64_t value : values) attribute.integer(8, value);
    return attribute.integer(20, 7);
  }
  static ProtoWriter begin_node(const std::string& type, const std::vector<std::string>& in, const std::string& out) {
    ProtoWriter node;
    for (const std::string& name : in) node.bytes(1, name);
    return node.bytes(2, out).bytes(3, out).bytes(4, type);
  }
  void tensor(const std::string& name, const std::vector<int64_t>& shape, const std::vector<float>& values) {
    ProtoWriter t;
    for (const int64_t size : shape) t.integer(1, size);
    graph_.message(5, t.integer(2, 1).bytes(8, name).bytes(9, raw(values)));
  }
  std::string next(const std::string& type) { return type + std::to_string(++count_); }

  int channels_;
  int count_ = 0;
  ProtoWriter graph_;
};

}  // namespace roadfix::test
