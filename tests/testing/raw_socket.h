// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

namespace rigcal::testing {

// A TCP connection to 127.0.0.1 without any protocol.
class RawSocket {
 public:
  // `from`: the own address, of this machine; empty: any.
  explicit RawSocket(int port, const std::string& from = "");
  ~RawSocket() { Close(); }
  RawSocket(RawSocket&& other) noexcept;
  RawSocket& operator=(RawSocket&&) = delete;

  bool connected() const { return descriptor_ >= 0; }
  void Send(const std::string& bytes) const;
  // What arrives next; empty: the other side has closed it, or sends nothing for `limit`.
  std::string Receive(std::chrono::milliseconds limit = std::chrono::seconds(30)) const;
  // Reads on until the other side has closed it. False: it has not for `limit`.
  bool AwaitEnd(std::chrono::milliseconds limit = std::chrono::seconds(30)) const;
  void Close();

 private:
  int descriptor_ = -1;
};

}  // namespace rigcal::testing
