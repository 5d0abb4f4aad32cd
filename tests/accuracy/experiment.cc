// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/experiment.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <map>

namespace rigcal::accuracy {

void OptionList::Add(const std::string& name, int* value, int low, int high,
                     const std::string& help) {
  command_->add_option(name, *value, help)->check(CLI::Range(low, high));
}

void OptionList::Add(const std::string& name, double* value, double low, double high,
                     const std::string& help) {
  command_->add_option(name, *value, help)->check(CLI::Range(low, high));
}

void OptionList::Add(const std::string& name, std::vector<double>* values, double low, double high,
                     const std::string& help) {
  command_->add_option(name, *values, help)->check(CLI::Range(low, high));
}

void OptionList::Add(const std::string& name, std::string* value, const std::string& help) {
  command_->add_option(name, *value, help);
}

void OptionList::AddFlag(const std::string& name, bool* value, const std::string& help) {
  command_->add_flag(name, *value, help);
}

int RunExperiment(const std::vector<Experiment>& experiments, int argc, const char* const* argv) {
  CLI::App app("Accuracy experiments: tables over many simulated rigs, and the real recording.",
               "rigcal-accuracy");
  app.require_subcommand(1);
  app.option_defaults()->always_capture_default();
  app.get_formatter()->label("SUBCOMMAND", "EXPERIMENT");
  std::map<const CLI::App*, Experiment::Run> runs;
  for (const Experiment& experiment : experiments) {
    CLI::App* command = app.add_subcommand(experiment.name, experiment.summary);
    command->group("Experiments");
    OptionList options(command);
    runs[command] = experiment.prepare(&options);
  }
  const auto is_named = [&](const Experiment& experiment) { return experiment.name == argv[1]; };
  if (argc > 1 && argv[1][0] != '-' &&
      std::none_of(experiments.begin(), experiments.end(), is_named)) {
    std::cerr << "no experiment '" << argv[1] << "'; there are:";
    for (const Experiment& experiment : experiments) std::cerr << ' ' << experiment.name;
    std::cerr << '\n';
    return 2;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return runs.at(app.get_subcommands().front())();
}

}  // namespace rigcal::accuracy
