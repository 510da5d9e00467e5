/* Waveform bridge: six channels sampled at 20 kHz, handed out through Modbus TCP.
 *
 * Register map: docs/modbus-bridge/README.md (a profile of acqd, no standard).
 * For: ESP32 (Arduino core 3.x), AD7606 (six of its eight inputs, +-10 V, simultaneous, 16 bit) on HSPI, W5500 on VSPI.
 *
 * NOT VERIFIED ON HARDWARE. Sampling queue, registers and Modbus code were compiled and run on a PC against stand-ins
 * for the Arduino functions; pins, SPI modes and the rates that an ESP32 with a W5500 reaches were not.
 * Voltage and current come from galvanically isolated transducers. Never connect mains to the converter.
 */
#include <Arduino.h>
#include <ETH.h>
#include <Preferences.h>
#include <SPI.h>
#include <atomic>

const int CONVST = 25, BUSY = 26, ADC_CS = 15, ADC_CLK = 14, ADC_MISO = 12, ADC_MOSI = 13;
const int ETH_CS = 5, ETH_IRQ = 4, ETH_RST = 16;
const float V_PER_DIGIT = 10.0f / 32768 * 60, A_PER_DIGIT = 10.0f / 32768 * 2;  // range / 32768 * transducer's ratio

const uint32_t RATE_MHZ = 20000000, CHANNELS = 6, FRAMES = 20, SAMPLE_BYTES = 2 * CHANNELS * FRAMES;
const uint32_t SLOTS = 256, SLOT0 = 64, STRIDE = 5 + CHANNELS * FRAMES, HEADER = 33;  // 64 KiB: 256 ms
const uint32_t QUEUE = 32, CLIENTS = 4;

struct Block { uint64_t first; uint8_t status, samples[SAMPLE_BYTES]; };
static Block queue[QUEUE];                      // from the sampling task (core 0) to loop() (core 1)
static std::atomic<uint32_t> filled{0}, taken{0}, overruns{0};
static uint8_t slots[SLOTS][2 * STRIDE], header[2 * HEADER];
static const uint32_t WRAP = 0xFFFFFFFF / SLOTS * SLOTS;  // block numbers start over here
static uint64_t blocks = 0;                              // newest block + 1, without the wrap
static uint16_t boot;
static SPIClass adc(HSPI);
static TaskHandle_t sampler;

static uint8_t *put(uint8_t *at, uint64_t value, int bytes) {  // high byte first, as Modbus sends it
  while (bytes--) *at++ = value >> (8 * bytes);
  return at;
}
static uint8_t *put_float(uint8_t *at, float value) {
  uint32_t bits;
  memcpy(&bits, &value, 4);
  return put(at, bits, 4);
}

/* ---- sampling ---- */

// One sampling instant; `codes` is null where its samples were not read in time. A block that is not whole, or for which
// the queue has no room, is dropped: its number is missing, and the sample time of the next block is still right.
void sample(const uint8_t *codes) {
  static uint64_t frame = 0;
  static bool whole;
  Block &block = queue[filled % QUEUE];
  uint32_t at = frame % FRAMES;
  if (at == 0) {
    whole = filled - taken < QUEUE;
    if (whole) block.first = frame, block.status = 0;
  }
  whole = whole && codes;
  if (whole) {
    memcpy(block.samples + 2 * CHANNELS * at, codes, 2 * CHANNELS);  // the AD7606 sends the high byte first too
    for (uint32_t k = 0; k < CHANNELS; k++) {
      int16_t code = codes[2 * k] << 8 | codes[2 * k + 1];
      if (code == 32767 || code == -32768) block.status |= 1;  // overrange
    }
  }
  if (at == FRAMES - 1) (whole ? filled : overruns)++;
  frame++;
}

void IRAM_ATTR converted() {  // BUSY fell: the conversion is complete
  BaseType_t woken = pdFALSE;
  vTaskNotifyGiveFromISR(sampler, &woken);
  portYIELD_FROM_ISR(woken);
}

void sampling_task(void *) {
  uint8_t codes[2 * CHANNELS];
  attachInterrupt(digitalPinToInterrupt(BUSY), converted, FALLING);
  for (;;) {
    uint32_t conversions = ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
    while (conversions-- > 1) sample(nullptr);  // the task came too late for these
    digitalWrite(ADC_CS, LOW);
    adc.transferBytes(nullptr, codes, sizeof codes);
    digitalWrite(ADC_CS, HIGH);
    sample(codes);
  }
}

/* ---- registers: written and read by loop() only, so each read is of one instant ---- */

void take_blocks() {
  for (; taken != filled; taken++) {
    const Block &block = queue[taken % QUEUE];
    uint64_t number = block.first / FRAMES;
    blocks = number + 1;
    uint8_t *at = slots[number % SLOTS];
    at = put(at, number % WRAP & 0xFFFF, 2);
    at = put(at, block.status, 2);
    at = put(at, block.first, 6);
    memcpy(at, block.samples, SAMPLE_BYTES);
  }
}

void write_header() {
  uint8_t *at = put(header, 0x41435144, 4);
  for (uint32_t value : {1u, CHANNELS, FRAMES}) at = put(at, value, 2);
  at = put(at, RATE_MHZ, 4);
  for (uint32_t value : {SLOTS, STRIDE, SLOT0}) at = put(at, value, 2);
  for (uint32_t k = 0; k < 6; k++) at = put_float(at, k >= CHANNELS ? 0 : k % 2 ? A_PER_DIGIT : V_PER_DIGIT);
  at = put(at, overruns, 4);
  at = put(at, blocks <= SLOTS ? 0 : (blocks - SLOTS) % WRAP, 4);
  at = put(at, blocks ? (blocks - 1) % WRAP : 0xFFFFFFFF, 4);
  at = put(at, 0, 8);  // no UTC
  put(at, boot, 2);
}

const uint8_t *registers(uint32_t address, uint32_t count) {
  if (address + count <= HEADER) return write_header(), header + 2 * address;
  if (address < SLOT0 || address + count > SLOT0 + SLOTS * STRIDE) return nullptr;
  return slots[0] + 2 * (address - SLOT0);
}

/* ---- Modbus TCP ---- */

// Answer of the PDU in `ask`; returns its length. Each request is answered, in the order of arrival.
size_t answer(const uint8_t *ask, size_t length, uint8_t *reply) {
  uint8_t function = ask[0], code = 0;
  const uint8_t *source = nullptr;
  uint32_t address = length < 5 ? 0 : ask[1] << 8 | ask[2], count = length < 5 ? 0 : ask[3] << 8 | ask[4];
  if (function != 3 && function != 4) code = 1;
  else if (length != 5 || count < 1 || count > 125) code = 3;
  else if (!(source = registers(address, count))) code = 2;
  reply[0] = code ? function | 0x80 : function;
  reply[1] = code ? code : 2 * count;
  if (!code) memcpy(reply + 2, source, 2 * count);
  return code ? 2 : 2 + 2 * count;
}

struct Connection { NetworkClient client; uint8_t data[264]; size_t have = 0; };
static Connection connections[CLIENTS];
static NetworkServer server(502);

void serve(Connection &each) {
  while (each.client.available()) {
    size_t want = each.have < 7 ? 7 : 6 + (each.data[4] << 8 | each.data[5]);
    if (want < 8 && each.have == 7) return each.client.stop();  // no function: not Modbus
    if (want > sizeof each.data) return each.client.stop();
    int got = each.client.read(each.data + each.have, want - each.have);
    if (got <= 0) return;
    each.have += got;
    if (each.have < want || want == 7) continue;
    uint8_t reply[7 + 252];
    size_t length = answer(each.data + 7, want - 7, reply + 7);
    memcpy(reply, each.data, 7);  // transaction, protocol, unit
    put(reply + 4, length + 1, 2);
    each.client.write(reply, 7 + length);
    each.have = 0;
  }
}

void accept_clients() {
  NetworkClient fresh = server.accept();
  if (!fresh) return;
  for (Connection &each : connections)
    if (!each.client.connected()) {
      fresh.setNoDelay(true);
      each.client = fresh;
      each.have = 0;
      return;
    }
  fresh.stop();
}

void setup() {
  Preferences stored;  // the boot counter survives without supply
  stored.begin("bridge");
  boot = stored.getUShort("boot", 0) + 1;
  stored.putUShort("boot", boot);
  stored.end();
  for (auto &slot : slots) put(slot, 0xFFFF0004, 4);  // no block yet: samples invalid

  pinMode(BUSY, INPUT);
  pinMode(ADC_CS, OUTPUT);
  digitalWrite(ADC_CS, HIGH);
  adc.begin(ADC_CLK, ADC_MISO, ADC_MOSI, -1);
  adc.beginTransaction(SPISettings(20000000, MSBFIRST, SPI_MODE2));
  SPI.begin();
  ETH.begin(ETH_PHY_W5500, 1, ETH_CS, ETH_IRQ, ETH_RST, SPI);
  server.begin();
  xTaskCreatePinnedToCore(sampling_task, "sampling", 4096, nullptr, configMAX_PRIORITIES - 1, &sampler, 0);
  ledcAttach(CONVST, RATE_MHZ / 1000, 8);  // the rising edge starts a conversion: the clock is hardware, without jitter
  ledcWrite(CONVST, 128);
}

void loop() {
  take_blocks();
  accept_clients();
  for (Connection &each : connections) serve(each);
}
