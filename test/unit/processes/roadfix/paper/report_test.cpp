#include "roadfix/paper/report.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

PaperReport small_report() {
  PaperReport report;
  report.title = "table 1";
  report.source = "Someone (2025)";
  report.drive = "a <drive>";
  report.notes = {"a note"};
  report.scored = {0.0, 10.0};
  report.tables = {{"table_1", "Table 1", {"estimate", "ATE m"}, {{"one, \"two\"", {0.25}}, {"none", {{}}}}}};
  report.plots = {{"Error", "", "m", true, {}, {{"one", {}}}}};
  for (int i = 0; i < 10000; ++i)
    report.plots[0].series[0].points.emplace_back(0.001 * i, i == 4321 ? 99.5 : std::sin(i));
  report.maps = {{"Map", "", {{"reference", {{0.0, 0.0}, {1.0, 2.0}}}}}};
  return report;
}

TEST_CASE("a table as text and as CSV, what is not there is said") {
  const PaperReport report = small_report();
  CHECK(paper_csv(report.tables[0]) == "estimate,ATE m\n\"one, \"\"two\"\"\",0.25\nnone,\n");
  const std::string text = paper_text(report);
  CHECK(text.find("0.2500") != std::string::npos);
  CHECK(text.find("none               -") != std::string::npos);
  CHECK(text.find("note: a note") != std::string::npos);
}

TEST_CASE("a row with too few values is an error of the program") {
  PaperReport report = small_report();
  report.tables[0].rows[0].values.clear();
  CHECK_THROWS_AS(paper_text(report), std::logic_error);
  CHECK_THROWS_AS(paper_csv(report.tables[0]), std::logic_error);
  CHECK_THROWS_AS(paper_page(report), std::logic_error);
}

TEST_CASE("the page holds everything itself, and thinning keeps the peak") {
  const std::string page = paper_page(small_report());
  for (const char* key : {"@TITLE@", "@CSS@", "@JS@", "@DATA@"}) CHECK(page.find(key) == std::string::npos);
  CHECK(page.find("<h1>a &lt;drive>: table 1</h1>") != std::string::npos);
  CHECK(page.find("https://") == std::string::npos);
  CHECK(page.find("function timePlot") != std::string::npos);
  CHECK(page.find("99.5") != std::string::npos);
  CHECK(page.size() < 200000);
}

}  // namespace
}  // namespace roadfix
