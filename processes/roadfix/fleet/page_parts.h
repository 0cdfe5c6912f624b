/// The parts of a fleet's page, embedded from page.html and page.js; its style is that of every report.
#pragma once

namespace roadfix {

extern const char* const kFleetPageHtml;
extern const char* const kFleetPageJs;

}  // namespace roadfix
