// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace rigcal::accuracy {

// results[i] = run(i) for i in [0, count), on `threads` threads; the results do not depend on how
// many. Result must be default constructible.
template <typename Result, typename Run>
std::vector<Result> RunAll(int count, int threads, Run run) {
  std::vector<Result> results(static_cast<size_t>(count));
  std::atomic<int> next = 0;
  std::vector<std::thread> workers;
  for (int t = 0; t < threads; ++t) {
    workers.emplace_back([&] {
      for (int i = next++; i < count; i = next++) results[static_cast<size_t>(i)] = run(i);
    });
  }
  for (std::thread& worker : workers) worker.join();
  return results;
}

}  // namespace rigcal::accuracy
