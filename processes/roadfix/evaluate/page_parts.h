/// The parts of the report page, embedded from page.html, page.css and the scripts, and what all report pages draw with.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace roadfix {

extern const char* const kPageHtml;
extern const char* const kPageCss;
extern const char* const kPageJs;
extern const char* const kDrawJs;
extern const char* const kTimePlotJs;

/// Puts a value in place of `@KEY@`.
void replace_all(std::string& text, std::string_view key, const std::string& value);
/// As text of a page.
std::string html_safe(const std::string& text);
/// As the text of a script element.
std::string script_safe(const nlohmann::ordered_json& json);

}  // namespace roadfix
