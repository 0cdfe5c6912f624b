/// The page's files, built into the program: nothing is read or fetched at run time.
#pragma once

#include <string>

namespace roadfix {

struct PageFile {
  const char* path;  ///< "/index.html"
  const char* mime;
  const char* text;
};

/// Null where there is no such file.
const PageFile* page_file(const std::string& path);

}  // namespace roadfix
