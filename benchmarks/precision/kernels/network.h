/* A ReLU network between float64 rows and forces. Whoever includes this says how one layer is computed. */
#ifndef NETWORK_H
#define NETWORK_H

#include <immintrin.h>
#include <stddef.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))
#define UNROLL _Pragma("GCC unroll 16")

enum { MOST_LAYERS = 8, MOST_WIDTH = 512, MOST_COLUMNS = 16, FORCES = 3, LANES = 16 };

typedef struct {
  int inputs, outputs;  /* outputs padded to whole vectors */
  const void *weights;  /* as the kernel wants them, 64-byte aligned, zeros past the outputs */
  const float *scales;  /* of a byte, by output; NULL where there is none */
  const float *biases;
} layer;

static struct {
  int layers, columns;
  layer at[MOST_LAYERS];
  double mean[MOST_COLUMNS], gain[MOST_COLUMNS], force_mean[FORCES], force_scale[FORCES];
} net;

void set_layer(int index, int inputs, int outputs, const void *weights, const float *scales, const float *biases) {
  net.at[index] = (layer){inputs, outputs, weights, scales, biases};
  net.layers = index + 1;
}

void set_normalizers(int columns, const double *mean, const double *scale, const double *force_mean,
                     const double *force_scale) {
  net.columns = columns;
  for (int i = 0; i < columns; i++) {
    net.mean[i] = mean[i];
    net.gain[i] = 1.0 / scale[i];
  }
  for (int n = 0; n < FORCES; n++) {
    net.force_mean[n] = force_mean[n];
    net.force_scale[n] = force_scale[n];
  }
}

/* Writes all outputs of a layer, rectified unless it is the last one. */
static void affine(int index, const float *in, float *out, int rectified);

void evaluate(const double *row, double *forces) {
  _Alignas(64) float value[2][MOST_WIDTH];
  for (int i = 0; i < net.columns; i++) value[0][i] = (float)((row[i] - net.mean[i]) * net.gain[i]);
  for (int index = 0; index < net.layers; index++)
    affine(index, value[index % 2], value[(index + 1) % 2], index + 1 < net.layers);
  for (int n = 0; n < FORCES; n++)
    forces[n] = net.force_mean[n] + net.force_scale[n] * (double)value[net.layers % 2][n];
}

#endif
