/// What `roadfix paper` shows of an experiment: tables, plots over time and maps; as text for a terminal, as CSV and as one
/// page that needs nothing but a browser.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evaluation/evaluate.h"

namespace roadfix {

struct PaperTable {
  struct Row {
    std::string name;
    std::vector<std::optional<double>> values;  ///< one per column but the first
  };
  std::string name;  ///< of its CSV file, without the ending
  std::string title;
  std::vector<std::string> columns;  ///< with units; the first is that of the rows' names
  std::vector<Row> rows;
  bool file_only = false;  ///< too long to print
};

struct PaperSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< s, value
};

struct PaperPlot {
  std::string title;
  std::string hint;
  std::string unit;
  bool logarithmic = false;
  std::optional<double> line;  ///< a value that is marked
  std::vector<PaperSeries> series;
};

struct PaperMap {
  struct Path {
    std::string name;
    std::vector<Eigen::Vector2d> points;  ///< m
  };
  std::string title;
  std::string hint;
  std::vector<Path> paths;  ///< the first is the reference
};

struct PaperReport {
  std::string title;
  std::string source;                                ///< the paper
  std::string drive;                                 ///< its name
  std::pair<double, double> scored;                  ///< s
  std::vector<std::pair<double, double>> intervals;  ///< s, shaded in the plots
  std::vector<std::string> notes;
  std::vector<PaperTable> tables;
  std::vector<PaperPlot> plots;
  std::vector<PaperMap> maps;
};

/// Throws std::logic_error where a row has not one value per column.
std::string paper_text(const PaperReport& report);
std::string paper_csv(const PaperTable& table);
std::string paper_page(const PaperReport& report);

/// Name of the drive, time scored, outages and notes of an evaluation.
void add_drive(const Reference& reference, const DriveFacts& facts, const std::vector<std::string>& notes,
               PaperReport& report);
/// Position error over time since the beginning of the drive's facts.
PaperSeries error_series(const std::string& name, const ChannelScore& score, const DriveFacts& facts);
PaperSeries horizontal_series(const std::string& name, const ChannelScore& score, const DriveFacts& facts);
PaperMap::Path reference_path(const Reference& reference);
PaperMap::Path estimate_path(const std::string& name, const ChannelScore& score);

/// A figure of a score, none where nothing was scored.
std::optional<double> scored(const ChannelScore& score, double value);

}  // namespace roadfix
