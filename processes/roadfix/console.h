/// What the tool says on standard error: whole lines, each under the subcommand's name, none on the line of another.
#pragma once

#include <string>

namespace roadfix {

/// "roadfix COMMAND: TEXT". Ends a line of progress that is open, and comes after what was printed before.
void say(const std::string& command, const std::string& text);

/// How far a subcommand has come: on a terminal one line that is written over, elsewhere a line for each tenth, and
/// nothing there unless `asked_for` (--progress). One at a time. Its end, also by an exception, ends the line.
class ProgressLine {
 public:
  ProgressLine(std::string command, bool asked_for);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// `share` from 0 to 1; `detail` follows the percentage.
  void show(double share, const std::string& detail = "");
  /// What a terminal shows stands on a line of its own from here on.
  void end_line();

 private:
  std::string command_;
  bool terminal_ = false;
  bool shown_ = false;
  bool open_ = false;      ///< the cursor stands behind the text
  std::size_t width_ = 0;  ///< of the text that is written over
  int last_tenth_ = -1;
};

}  // namespace roadfix
