// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "common/identity/identity_folder.h"

namespace rigcal {

// Keeps the certificate of a program that runs for long: looks every `interval` whether it is due,
// asks the server at the start and every day in any case, and replaces it in its folder.
class RenewalThread {
 public:
  struct Events {
    std::function<void()> renewed;                    // the folder has a new certificate
    std::function<void(const std::string&)> trouble;  // it could not be renewed, and why
  };
  // `ask_again`: the least time between two questions for which AskSoon was called.
  RenewalThread(IdentityFolder folder, Events events,
                std::chrono::milliseconds interval = std::chrono::minutes(10),
                std::chrono::milliseconds ask_again = std::chrono::seconds(10));
  ~RenewalThread() { Shutdown(); }
  RenewalThread(const RenewalThread&) = delete;
  RenewalThread& operator=(const RenewalThread&) = delete;

  void Start();
  // No event comes after it.
  void Shutdown();
  // The server is to be asked even if nothing seems due, soon: it may refuse the
  // certificate, and then says why, or gives a new one. Where its HTTPS port does not answer, the
  // handshake of its gRPC port is tried. From any thread.
  void AskSoon();

 private:
  void Run();
  void RenewOnce(bool ask_anyway);

  const IdentityFolder folder_;
  const Events events_;
  const std::chrono::milliseconds interval_;
  const std::chrono::milliseconds ask_again_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  bool ask_ = true;
  std::chrono::steady_clock::time_point asked_;
  // Of the thread alone.
  std::string last_trouble_;  // not to be told again and again
  std::thread thread_;
};

}  // namespace rigcal
