// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace rigcal::accuracy {

// Declares the command-line options of one experiment. A variable keeps its value, which is the
// default in the help, unless the option is given.
class OptionList {
 public:
  explicit OptionList(CLI::App* command) : command_(command) {}

  // Refuses values outside [low, high].
  void Add(const std::string& name, int* value, int low, int high, const std::string& help);
  void Add(const std::string& name, double* value, double low, double high,
           const std::string& help);
  void Add(const std::string& name, std::vector<double>* values, double low, double high,
           const std::string& help);
  void Add(const std::string& name, std::string* value, const std::string& help);
  void AddFlag(const std::string& name, bool* value, const std::string& help);

 private:
  CLI::App* command_;
};

// One experiment of `rigcal-accuracy`.
struct Experiment {
  // Runs with the parsed options, prints its tables, returns the exit code.
  using Run = std::function<int()>;

  std::string name;
  std::string summary;  // one line of the help
  std::function<Run(OptionList* options)> prepare;
};

// All experiments, in the order of the help (docs/accuracy.md explains each).
std::vector<Experiment> AllExperiments();

// Parses `EXPERIMENT [OPTIONS]`, runs it and returns the exit code; 2 for wrong usage.
int RunExperiment(const std::vector<Experiment>& experiments, int argc, const char* const* argv);

}  // namespace rigcal::accuracy
