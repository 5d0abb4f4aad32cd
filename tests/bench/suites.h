// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace rigcal::bench {

// CPU times of the repetitions of each benchmark, by its name, in the order of their first run.
class MeasuredTimes {
 public:
  void Add(const std::string& name, double time);
  const std::vector<std::string>& names() const { return names_; }
  bool Contains(const std::string& name) const { return times_.contains(name); }
  // Of a benchmark that was run.
  double Shortest(const std::string& name) const;
  double Median(const std::string& name) const;

 private:
  std::vector<std::string> names_;
  std::map<std::string, std::vector<double>> times_;
};

// The benchmarks of one file. Their names begin with "<suite>/".
struct Suite {
  const char* name;
  const char* summary;  // one line of the help
  void (*register_benchmarks)();
  void (*print_ratios)(const MeasuredTimes& times) = nullptr;  // after all runs
};

Suite BesideSolveSuite();
Suite CalibrateSuite();
Suite DetectSuite();
Suite EventSuite();
Suite IngestSuite();
// Its part without a server of ours.
void RegisterBareInsert();
Suite LiveSuite();
Suite RecordedSuite();
Suite SolveSuite();
Suite SpoolSuite();
Suite StoreSuite();

}  // namespace rigcal::bench
