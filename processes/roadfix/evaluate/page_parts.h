/// The parts of the report page, embedded from page.html, page.css and page.js.
#pragma once

namespace roadfix {

extern const char* const kPageHtml;
extern const char* const kPageCss;
extern const char* const kPageJs;

}  // namespace roadfix
