/* What the peers on DDS have in common: their command line, an image as CDR, and what they report.
 *
 *   PEER publish   --domain D --topic T [--type Y] [--width W --height H] [--rate R] [--count N] [--depth K]
 *                  [--reliable] [--held] [--encoding E] [--linger S]
 *   PEER subscribe --domain D --topic T [--type Y] [--count N] [--seconds S] [--depth K] [--reliable] [--latched]
 *   PEER discover  --domain D --topic T [--seconds S]
 *   PEER call      --domain D --topic SERVICE --type PACKAGE::srv::dds_::NAME_ [--seconds S] [--request HEX]
 *   PEER calls     the same, with [--count N]
 *
 * Topics and types are named as on DDS (rt/camera/image_raw, sensor_msgs::msg::dds_::Image_). `publish` waits for a
 * subscriber, with --held for a line on stdin too, and sends N images a R-th of a second apart, each stamped when it is
 * sent; then it stays for S seconds. E other than 1 is a header that lies: not little-endian CDR. --stripe sends a laser stripe in the dark instead of a pattern. `subscribe` takes any
 * message that begins with a std_msgs/Header, until it has N or S seconds are over. `discover` waits for a publisher and
 * reports its type and user data. `call` sends a request,
 * empty without --request, and prints the reply. `calls` sends N, each once the reply to the one before it is there or
 * S seconds are over, and prints what became of them. A request is CDR with its header. K is how many messages are kept. Each line on stdout is one JSON object.
 */
#ifndef PEER_H
#define PEER_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define NS_PER_S 1000000000LL
/* Header of CDR, then seconds and nanoseconds of the stamp. */
#define STAMP_AT 4
#define MAX_LATENCIES 1000000

struct options {
  const char *verb, *topic, *type, *request;
  int domain, width, height, count, depth, encoding, is_reliable, is_latched, is_stripe, is_held;
  double rate, seconds, linger;
};

static int64_t wall_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return now.tv_sec * NS_PER_S + now.tv_nsec;
}

static void sleep_until_ns(int64_t wall) {
  struct timespec until = {(time_t)(wall / NS_PER_S), (long)(wall % NS_PER_S)};
  while (clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &until, NULL) != 0) {
  }
}

static void fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  exit(1);
}

static struct options parse(int argc, char **argv) {
  struct options o = {"", "", "sensor_msgs::msg::dds_::Image_", "0001000000", 0, 640, 480, 10, 10, 1, 0, 0, 0, 0, 10.0, 30.0, 1.0};
  if (argc > 1) o.verb = argv[1];
  for (int i = 2; i < argc; i++) {
    const char *name = argv[i];
    if (!strcmp(name, "--reliable")) { o.is_reliable = 1; continue; }
    if (!strcmp(name, "--held")) { o.is_held = 1; continue; }
    if (!strcmp(name, "--stripe")) { o.is_stripe = 1; continue; }
    if (!strcmp(name, "--latched")) { o.is_latched = o.is_reliable = 1; continue; }
    const char *value = i + 1 < argc ? argv[++i] : "";
    if (!strcmp(name, "--domain")) o.domain = atoi(value);
    else if (!strcmp(name, "--topic")) o.topic = value;
    else if (!strcmp(name, "--type")) o.type = value;
    else if (!strcmp(name, "--request")) o.request = value;
    else if (!strcmp(name, "--width")) o.width = atoi(value);
    else if (!strcmp(name, "--height")) o.height = atoi(value);
    else if (!strcmp(name, "--count")) o.count = atoi(value);
    else if (!strcmp(name, "--depth")) o.depth = atoi(value);
    else if (!strcmp(name, "--encoding")) o.encoding = atoi(value);
    else if (!strcmp(name, "--rate")) o.rate = atof(value);
    else if (!strcmp(name, "--seconds")) o.seconds = atof(value);
    else if (!strcmp(name, "--linger")) o.linger = atof(value);
    else fail(name);
  }
  if (!*o.topic) fail("--topic is missing");
  return o;
}

static void say(const char *event) {
  printf("{\"event\": \"%s\"}\n", event);
  fflush(stdout);
}

/* Returns when a line has come on stdin. */
static void hold(const struct options *o) {
  if (!o->is_held) return;
  for (int letter = 0; letter != '\n' && letter != EOF;) letter = getchar();
}

/* ---- an image ---- */

static uint8_t *put(uint8_t *at, const void *bytes, size_t length) {
  memcpy(at, bytes, length);
  return at + length;
}

static uint8_t *put_u32(uint8_t *at, uint32_t value) { return put(at, &value, sizeof value); }

/* A stripe along the middle row, 9 pixels wide, on a ground of 5. */
static uint8_t stripe_level(const struct options *o, uint32_t pixel) {
  static const uint8_t levels[] = {200, 180, 130, 70, 30};
  const int distance = abs((int)(pixel / (uint32_t)o->width) - o->height / 2);
  return distance < 5 ? levels[distance] : 5;
}

/* A mono8 image whose pixels count up from 0 to 250 and over again. */
static uint8_t *new_image(const struct options *o, size_t *length) {
  const uint32_t num_pixels = (uint32_t)o->width * (uint32_t)o->height;
  uint8_t *image = (uint8_t *)calloc(1, num_pixels + 128);
  uint8_t *at = put(image, "\0\1\0\0", 4) + 8;
  at = put(put_u32(at, 7), "camera\0\0", 8);
  at = put_u32(put_u32(at, (uint32_t)o->height), (uint32_t)o->width);
  at = put(put_u32(at, 6), "mono8\0\0\0", 8);
  at = put_u32(put_u32(at, (uint32_t)o->width), num_pixels);
  for (uint32_t i = 0; i < num_pixels; i++) at[i] = o->is_stripe ? stripe_level(o, i) : (uint8_t)(i % 251);
  image[1] = (uint8_t)o->encoding;
  *length = (size_t)(at - image) + num_pixels;
  return image;
}

static void stamp(uint8_t *message) {
  const int64_t now = wall_ns();
  put_u32(put_u32(message + STAMP_AT, (uint32_t)(now / NS_PER_S)), (uint32_t)(now % NS_PER_S));
}

/* ---- what was received ---- */

struct tally {
  int64_t *latencies_ns, first_ns, last_ns, bytes;
  int count;
};

static void enter_since(struct tally *t, int64_t sent_ns, size_t length) {
  if (t->count == MAX_LATENCIES) return;
  if (!t->latencies_ns) t->latencies_ns = (int64_t *)malloc(MAX_LATENCIES * sizeof(int64_t));
  t->last_ns = wall_ns();
  if (t->count == 0) t->first_ns = t->last_ns;
  t->latencies_ns[t->count++] = t->last_ns - sent_ns;
  t->bytes += (int64_t)length;
}

static void enter(struct tally *t, const uint8_t *message, size_t length) {
  uint32_t seconds, nanoseconds;
  if (length < STAMP_AT + 8) return;
  memcpy(&seconds, message + STAMP_AT, 4);
  memcpy(&nanoseconds, message + STAMP_AT + 4, 4);
  enter_since(t, seconds * NS_PER_S + nanoseconds, length);
}

static int by_size(const void *a, const void *b) {
  const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
  return (x > y) - (x < y);
}

static void report_as(const char *event, struct tally *t) {
  if (t->count) qsort(t->latencies_ns, (size_t)t->count, sizeof(int64_t), by_size);
#define PERCENTILE(p) (t->count ? (double)t->latencies_ns[(t->count - 1) * (p) / 100] / 1e6 : 0.0)
  const double seconds = (double)(t->last_ns - t->first_ns) / 1e9;
  printf("{\"event\": \"%s\", \"count\": %d, \"bytes\": %lld, \"hz\": %.2f, \"p50_ms\": %.3f, "
         "\"p99_ms\": %.3f, \"max_ms\": %.3f}\n",
         event, t->count, (long long)t->bytes, seconds > 0 ? (t->count - 1) / seconds : 0.0, PERCENTILE(50),
         PERCENTILE(99), PERCENTILE(100));
  fflush(stdout);
}

static void report(struct tally *t) { report_as("received", t); }

static void report_sent(int count, int64_t started_ns) {
  printf("{\"event\": \"sent\", \"count\": %d, \"seconds\": %.3f}\n", count, (double)(wall_ns() - started_ns) / 1e9);
  fflush(stdout);
}

/* A message written in hexadecimal; returns its length. */
static size_t parse_hex(const char *hex, uint8_t *message, size_t capacity) {
  size_t length = 0;
  for (unsigned byte; length < capacity && sscanf(hex + 2 * length, "%2x", &byte) == 1; length++) {
    message[length] = (uint8_t)byte;
  }
  return length;
}

static void report_publisher(const char *type, const uint8_t *user_data, size_t length) {
  printf("{\"event\": \"publisher\", \"type\": \"%s\", \"user_data\": \"%.*s\"}\n", type, (int)length,
         (const char *)user_data);
  fflush(stdout);
}

static void report_reply(const uint8_t *message, size_t length) {
  printf("{\"event\": \"reply\", \"hex\": \"");
  for (size_t i = 0; i < length; i++) printf("%02x", message[i]);
  printf("\"}\n");
  fflush(stdout);
}

#endif
