#include "roadfix/mcap/unpack.h"

#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include <limits>

namespace roadfix {
namespace {

// Writers cut chunks at some MB; what claims more than this is damaged, or made to exhaust us.
constexpr uint64_t kMaxChunkBytes = uint64_t{1} << 30U;
// No packer makes less of real data than this; it bounds what a few hostile bytes can make us allocate.
constexpr uint64_t kMaxRatio = 4096;
constexpr uint64_t kSmall = uint64_t{1} << 20U;

std::string size_error(uint64_t size, uint64_t wanted) {
  return size == wanted ? "" : fmt::format("unpacks to {} bytes, {} were told", size, wanted);
}

std::string unpack_zstd(std::span<const uint8_t> packed, std::vector<uint8_t>& out) {
  const std::size_t size = ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size());
  if (ZSTD_isError(size) != 0) return std::string("zstd: ") + ZSTD_getErrorName(size);
  return size_error(size, out.size());
}

std::string unpack_lz4(std::span<const uint8_t> packed, std::vector<uint8_t>& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return "lz4: no memory";
  std::size_t done = 0, used = 0, hint = 1;
  std::string error;
  while (hint != 0 && used < packed.size()) {
    std::size_t room = out.size() - done, taken = packed.size() - used;
    hint = LZ4F_decompress(context, out.data() + done, &room, packed.data() + used, &taken, nullptr);
    if (LZ4F_isError(hint) != 0) {
      error = std::string("lz4: ") + LZ4F_getErrorName(hint);
      break;
    }
    done += room;
    used += taken;
    if (room == 0 && taken == 0) break;
  }
  LZ4F_freeDecompressionContext(context);
  if (error.empty() && hint != 0) error = done < out.size() ? "lz4: ends too early" : "lz4: unpacks to more than told";
  return error.empty() ? size_error(done, out.size()) : error;
}

std::string unpack_bz2(std::span<const uint8_t> packed, std::vector<uint8_t>& out) {
  auto size = static_cast<unsigned>(out.size());
  auto* from = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
  const int code = BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(out.data()), &size, from,
                                              static_cast<unsigned>(packed.size()), 0, 0);
  if (code == BZ_OUTBUFF_FULL) return "bzip2: unpacks to more than told";
  if (code == BZ_UNEXPECTED_EOF) return "bzip2: ends too early";
  if (code != BZ_OK) return fmt::format("bzip2: is damaged (code {})", code);
  return size_error(size, out.size());
}

}  // namespace

std::string unpack(const std::string& name, std::span<const uint8_t> packed, uint64_t size, std::vector<uint8_t>& out) {
  if (size > kMaxChunkBytes || size > std::max(kSmall, packed.size() * kMaxRatio)) {
    return fmt::format("{} bytes cannot unpack to {}", packed.size(), size);
  }
  if (name.empty() || name == "none") {
    out.assign(packed.begin(), packed.end());
    return size_error(packed.size(), size);
  }
  out.resize(static_cast<std::size_t>(size));
  if (name == "zstd") return unpack_zstd(packed, out);
  if (name == "lz4") return unpack_lz4(packed, out);
  if (name == "bz2") return unpack_bz2(packed, out);
  return fmt::format("compression '{}' is none of zstd, lz4, bz2", name.substr(0, 20));
}

}  // namespace roadfix
