/// Names the sources and flags of a build. Programs get the real one (cmake/build_id.cmake); a test, which nobody
/// ships, keeps the library's own answer, so that it is not linked again whenever any source changes.
#pragma once

namespace roadfix {

const char* build_id_text();

}  // namespace roadfix
