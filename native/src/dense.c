#include "grouser/dense.h"

#include <stdint.h>
#include <string.h>

#include "cpu.h"

/* exp(x) to a few units in the last place, without branches: x = k ln 2 + r, then 2^k times a Taylor sum in r. */
static inline float exponential(float x) {
  static const float LOG2E = 1.44269504f, LN2_HIGH = 0.693359375f, LN2_LOW = -2.12194440e-4f,
                     SHIFT = 12582912.0f; /* 1.5 * 2^23 */
  const float limited = x < -87.0f ? -87.0f : x > 88.0f ? 88.0f : x;
  const float shifted = limited * LOG2E + SHIFT;
  const float k = shifted - SHIFT;
  const float r = (limited - k * LN2_HIGH) - k * LN2_LOW;
  float p = 1.0f / 5040.0f;
  p = p * r + 1.0f / 720.0f;
  p = p * r + 1.0f / 120.0f;
  p = p * r + 1.0f / 24.0f;
  p = p * r + 1.0f / 6.0f;
  p = p * r + 0.5f;
  uint32_t bits;
  float scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 127u) << 23;
  memcpy(&scale, &bits, sizeof scale);
  return scale + scale * (r + r * r * p);
}

/* Activations of z, with their derivatives. A NaN stays one. */
GROUSER_CLONES
static void activate(enum grouser_activation kind, const float *restrict z, float *restrict value,
                     float *restrict slope, int count) {
  if (kind == GROUSER_RELU) {
    for (int n = 0; n < count; n++) {
      value[n] = z[n] < 0 ? 0.0f : z[n];
      slope[n] = z[n] > 0 ? 1.0f : 0.0f;
    }
  } else if (kind == GROUSER_SILU) {
    for (int n = 0; n < count; n++) {
      const float gate = 1.0f / (1.0f + exponential(-z[n]));
      value[n] = z[n] * gate;
      slope[n] = gate * (1.0f + z[n] * (1.0f - gate));
    }
  } else {
    for (int n = 0; n < count; n++) {
      const float t = 1.0f - 2.0f / (1.0f + exponential(2.0f * z[n]));
      value[n] = t;
      slope[n] = 1.0f - t * t;
    }
  }
}

/* One input at a time against a row of outputs: the additions keep their order at every vector width. */
GROUSER_CLONES
static void affine(const float *restrict weights, const float *restrict bias, const float *restrict in, int inputs,
                   float *restrict out, int outputs) {
  memcpy(out, bias, sizeof(float) * (size_t)outputs);
  for (int i = 0; i < inputs; i++) {
    const float *restrict row = weights + (size_t)i * (size_t)outputs;
    const float value = in[i];
    for (int o = 0; o < outputs; o++) out[o] += value * row[o];
  }
}

/* back[n][i] = sum over o of weights[i][o] * front[n][o], in sixteen running sums. */
GROUSER_CLONES
static void transpose_apply(const float *restrict weights, const float *restrict front, int inputs, int outputs,
                            int stride, float *restrict back) {
  enum { LANES = 16 };
  for (int n = 0; n < GROUSER_SEEDS; n++) {
    const float *restrict from = front + (size_t)n * (size_t)stride;
    for (int i = 0; i < inputs; i++) {
      const float *restrict row = weights + (size_t)i * (size_t)outputs;
      float lane[LANES] = {0}, sum = 0;
      int o = 0;
      for (; o + LANES <= outputs; o += LANES)
        for (int l = 0; l < LANES; l++) lane[l] += row[o + l] * from[o + l];
      for (int l = 0; l < LANES; l++) sum += lane[l];
      for (; o < outputs; o++) sum += row[o] * from[o];
      back[(size_t)n * (size_t)stride + (size_t)i] = sum;
    }
  }
}

void grouser_dense_forward(const grouser_dense *net, const float *inputs, float *outputs, grouser_slopes slopes) {
  float value[GROUSER_MAX_WIDTH], next[GROUSER_MAX_WIDTH];
  const int last = net->layers - 1;
  memcpy(value, inputs, sizeof(float) * (size_t)net->widths[0]);
  for (int layer = 0; layer < last; layer++) {
    const int width = net->widths[layer + 1];
    affine(net->weights[layer], net->biases[layer], value, net->widths[layer], next, width);
    activate(net->activation, next, value, slopes[layer], width);
  }
  affine(net->weights[last], net->biases[last], value, net->widths[last], outputs, net->widths[net->layers]);
}

void grouser_dense_backward(const grouser_dense *net, grouser_slopes slopes,
                            float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH]) {
  float back[GROUSER_SEEDS * GROUSER_MAX_WIDTH];
  for (int layer = net->layers - 1; layer >= 0; layer--) {
    const int width = net->widths[layer];
    transpose_apply(net->weights[layer], rows, width, net->widths[layer + 1], GROUSER_MAX_WIDTH, back);
    for (int n = 0; n < GROUSER_SEEDS; n++)
      for (int i = 0; i < width; i++)
        rows[n * GROUSER_MAX_WIDTH + i] =
            back[n * GROUSER_MAX_WIDTH + i] * (layer > 0 ? slopes[layer - 1][i] : 1.0f);
  }
}
