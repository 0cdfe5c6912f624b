/// One evaluation as text for a terminal, as JSON and as a page that needs nothing but a browser.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evaluation/evaluate.h"
#include "roadfix/evaluate/fusion_series.h"

namespace roadfix {

struct EvaluationReport {
  DriveFacts facts;
  Reference reference;
  std::vector<ChannelScore> channels;
  FusionSeries fusion;
  std::vector<std::string> notes;
};

/// A table per channel and one row per channel at the end.
std::string report_table(const EvaluationReport& report);

/// Every figure; keys carry units.
nlohmann::ordered_json report_json(const EvaluationReport& report);

/// The page with its plots; `created` is shown as it is.
std::string report_page(const EvaluationReport& report);

/// The series behind the plots, one row per scored pose.
std::string errors_csv(const ChannelScore& channel);

}  // namespace roadfix
