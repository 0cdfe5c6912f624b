/// Where the bytes of an output go until it is whole: beside its name, which it gets at the end, so that a run that
/// fails leaves what was there before. A name that is a link means the file behind it. A device or pipe has nothing
/// that could be replaced: it gets the bytes as they come.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace roadfix {

struct OutputPlace {
  std::filesystem::path path;     ///< of the whole output
  std::filesystem::path written;  ///< PATH.part; `path` itself where that is a device or pipe
};

inline OutputPlace output_place(const std::filesystem::path& wanted) {
  std::error_code ignored;
  const std::filesystem::file_status status = std::filesystem::status(wanted, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) return {wanted, wanted};
  std::filesystem::path path = wanted;
  if (std::filesystem::is_symlink(wanted, ignored) && std::filesystem::exists(status)) {
    path = std::filesystem::canonical(wanted);
  }
  return {path, path.string() + ".part"};
}

/// Throws std::runtime_error where writing `out` would replace `in`, under whatever name.
inline void refuse_to_replace(const std::filesystem::path& in, const std::filesystem::path& out) {
  const OutputPlace place = output_place(out);
  std::error_code ignored;
  for (const std::filesystem::path& path : {place.path, place.written}) {
    if (!std::filesystem::equivalent(in, path, ignored)) continue;
    throw std::runtime_error(path.string() + ": the output would replace the input");
  }
}

/// Throws std::runtime_error where `out` is a file that is there already, is not empty, and `overwrite` is not set.
inline void refuse_existing_file(const std::filesystem::path& out, bool overwrite) {
  std::error_code ignored;
  if (overwrite || !std::filesystem::is_regular_file(out, ignored)) return;
  if (std::filesystem::file_size(out, ignored) == 0) return;
  throw std::runtime_error(out.string() + ": is there already; --overwrite replaces it");
}

}  // namespace roadfix
