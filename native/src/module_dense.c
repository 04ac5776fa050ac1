#include <stdint.h>
#include <string.h>

#include "module.h"

int grouser_copy_doubles(PyObject *object, const char *name, Py_ssize_t count, double *out) {
  grouser_array array;
  if (grouser_array_acquire(object, name, count, 0, &array) < 0) return -1;
  const int fits = array.rows == 1;
  if (fits)
    memcpy(out, array.data, sizeof(double) * (size_t)count);
  else
    PyErr_Format(PyExc_ValueError, "%s must hold %zd values", name, count);
  grouser_array_release(&array);
  return fits ? 0 : -1;
}

static int read_widths(PyObject *widths, grouser_dense *net) {
  const Py_ssize_t count = PySequence_Size(widths);
  if (count < 0) return -1;
  if (count < 2 || count > GROUSER_MAX_LAYERS + 1) {
    PyErr_Format(PyExc_ValueError, "a network has 1 to %d layers, got %zd", GROUSER_MAX_LAYERS, count - 1);
    return -1;
  }
  net->layers = (int)count - 1;
  for (Py_ssize_t i = 0; i < count; i++) {
    PyObject *item = PySequence_GetItem(widths, i);
    if (!item) return -1;
    const long width = PyLong_AsLong(item);
    Py_DECREF(item);
    if (width == -1 && PyErr_Occurred()) return -1;
    if (width < 1 || width > GROUSER_MAX_WIDTH) {
      PyErr_Format(PyExc_ValueError, "layer widths must lie in [1, %d], got %ld", GROUSER_MAX_WIDTH, width);
      return -1;
    }
    net->widths[i] = (int)width;
  }
  return 0;
}

/* Copies `rows` x `columns` into padded rows of zeros and returns what follows them. */
static float *padded_copy(const float *from, int rows, int columns, int by_row, int by_column, float *to) {
  const int padded = grouser_padded(columns);
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < padded; c++) to[(size_t)r * (size_t)padded + (size_t)c] = c < columns ? from[r * by_row + c * by_column] : 0.0f;
  return to + (size_t)rows * (size_t)padded;
}

/* Lays the packed float32 parameters out as the kernels read them and points every layer there. */
static void *lay_out_parameters(PyObject *bytes, grouser_dense *net) {
  size_t given = 0, needed = 0;
  net->widest = GROUSER_PANEL;
  for (int layer = 0; layer < net->layers; layer++) {
    const int inputs = net->widths[layer], outputs = net->widths[layer + 1];
    given += (size_t)(inputs + 1) * (size_t)outputs;
    needed += (size_t)(inputs + 1) * (size_t)grouser_padded(outputs) + (size_t)outputs * (size_t)grouser_padded(inputs);
    if (grouser_padded(outputs) > net->widest) net->widest = grouser_padded(outputs);
  }
  char *data;
  Py_ssize_t length;
  if (PyBytes_AsStringAndSize(bytes, &data, &length) < 0) return NULL;
  if ((size_t)length != given * sizeof(float)) {
    PyErr_Format(PyExc_ValueError, "these layers need %zd bytes of float32 parameters, got %zd",
                 (Py_ssize_t)(given * sizeof(float)), length);
    return NULL;
  }
  void *memory = PyMem_Malloc(needed * sizeof(float) + GROUSER_ALIGNMENT);
  float *values = PyMem_Malloc((size_t)length);
  if (!memory || !values) {
    PyMem_Free(memory);
    PyMem_Free(values);
    return PyErr_NoMemory();
  }
  memcpy(values, data, (size_t)length);
  float *next = (float *)(((uintptr_t)memory + GROUSER_ALIGNMENT - 1) / GROUSER_ALIGNMENT * GROUSER_ALIGNMENT);
  const float *from = values;
  for (int layer = 0; layer < net->layers; layer++) {
    const int inputs = net->widths[layer], outputs = net->widths[layer + 1];
    const float *bias = from + (size_t)inputs * (size_t)outputs;
    net->weights[layer] = next;
    next = padded_copy(from, inputs, outputs, outputs, 1, next);
    net->biases[layer] = next;
    next = padded_copy(bias, 1, outputs, 0, 1, next);
    net->transposed[layer] = next;
    next = padded_copy(from, outputs, inputs, 1, outputs, next);
    from = bias + outputs;
  }
  PyMem_Free(values);
  return memory;
}

void *grouser_read_dense(int activation, PyObject *widths, PyObject *parameters, grouser_dense *net) {
  if (activation < GROUSER_RELU || activation > GROUSER_TANH) {
    PyErr_SetString(PyExc_ValueError, "activation must be 0 (relu), 1 (silu) or 2 (tanh)");
    return NULL;
  }
  net->activation = (enum grouser_activation)activation;
  return read_widths(widths, net) < 0 ? NULL : lay_out_parameters(parameters, net);
}
