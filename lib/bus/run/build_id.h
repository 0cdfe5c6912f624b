/// Names the sources and flags of a build. Programs get the real one (cmake/build_id.cmake); a test, which nobody
/// ships, keeps the library's own answer, so that it is not linked again whenever any source changes.
#pragma once

#include <string>

namespace roadfix {

const char* build_id_text();

/// "NAME VERSION (build ID)": what --version prints.
std::string version_text(const std::string& name);

}  // namespace roadfix
