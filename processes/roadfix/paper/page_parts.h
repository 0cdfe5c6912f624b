/// The parts of the papers' page, embedded from page.html and page.js.
#pragma once

namespace roadfix {

extern const char* const kPaperPageHtml;
extern const char* const kPaperPageJs;

}  // namespace roadfix
