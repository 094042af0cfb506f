// WebGL 2 programs of a scene: ellipsoids, dots, beams and lines; three calls draw everything.
import { hypot, max, min, sqrt } from "./maths";
/** Arrays of n points and s segments, in this order:
 * positions n x 3; matrices n x 9; colours n x 4, 0 to 255, alpha 0 hidden; hollow n, 1 a ring instead of a dot;
 * ends of segments s x 6; their points s x 2; their colours s x 4; their widths s, px times 10.
 */
export type Arrays = [Float32Array, Float32Array, Uint8Array, Uint8Array, Float32Array, Float32Array, Uint8Array, Uint8Array];
export interface Drawn {
  fill(arrays: Arrays): void;
  draw(matrix: Float32Array, eye: number[], size: [number, number], ratio: number, selected: number, segments: number, dot: number, ground: number[]): void;
}

/** Vertices and triangles of an icosahedron, each face divided into four where asked. */
export function icosphere(divided: boolean): { vertices: number[]; faces: number[] } {
  const t = (1 + sqrt(5)) / 2;
  const points: number[][] = [];
  for (const a of [-1, 1]) for (const b of [-t, t]) points.push([a, b, 0], [0, a, b], [b, 0, a]);
  // Faces are the triples of neighbours, 2 apart; in the order that shows its front outside.
  let faces: number[] = [];
  const near = (i: number, j: number) => hypot(...points[i]!.map((v, k) => v - points[j]![k]!)) < 2.1;
  for (let i = 0; i < 12; i++) for (let j = i + 1; j < 12; j++) for (let k = j + 1; k < 12; k++) {
    if (!near(i, j) || !near(j, k) || !near(i, k)) continue;
    const [p, q, r] = [points[i]!, points[j]!, points[k]!] as [number[], number[], number[]];
    const outward = p[0]! * (q[1]! * r[2]! - q[2]! * r[1]!) + p[1]! * (q[2]! * r[0]! - q[0]! * r[2]!) + p[2]! * (q[0]! * r[1]! - q[1]! * r[0]!);
    faces.push(...(outward > 0 ? [i, j, k] : [i, k, j]));
  }
  if (divided) {
    const middle = new Map<number, number>();
    const between = (i: number, j: number) => {
      const key = min(i, j) * 64 + max(i, j);
      if (!middle.has(key)) middle.set(key, points.push(points[i]!.map((v, k) => v + points[j]![k]!)) - 1);
      return middle.get(key)!;
    };
    const finer: number[] = [];
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [faces[f]!, faces[f + 1]!, faces[f + 2]!];
      const [d, e, g] = [between(a, b), between(b, c), between(c, a)];
      finer.push(a, d, g, b, e, d, c, g, e, d, e, g);
    }
    faces = finer;
  }
  return { vertices: points.flatMap((p) => p.map((v) => v / hypot(...p))), faces };
}

// Normals by the inverse transpose: the matrix has orthogonal columns, so that is each column over its square.
const SPHERE = `uniform mat4 m;uniform vec3 e;in vec3 p,o,a,b,c;in vec4 k;out vec3 n,d;out vec4 v;
void main(){vec3 q=o+a*p.x+b*p.y+c*p.z;n=a*p.x/dot(a,a)+b*p.y/dot(b,b)+c*p.z/dot(c,c);d=e-q;v=k;gl_Position=m*vec4(q,1);if(k.a==0.||dot(a,a)==0.)gl_Position=vec4(2,2,2,1);}`;
const SHADE = `in vec3 n,d;in vec4 v;out vec4 o;
void main(){o=vec4(v.rgb*(.35+.65*max(dot(normalize(n),normalize(d)),0.)),1);}`;
const DOT = `uniform mat4 m;uniform float s;in vec3 o;in vec4 k;in float h;out vec4 v;flat out float r;
void main(){v=k;r=h;gl_Position=m*vec4(o,1);gl_Position.z-=.0004*gl_Position.w;gl_PointSize=h>0.?s*2.4:s;if(k.a==0.)gl_Position=vec4(2,2,2,1);}`;
const DISC = `in vec4 v;flat in float r;out vec4 o;
void main(){float d=length(gl_PointCoord-.5)*2.;if(d>1.||(r>0.&&d<.62))discard;o=vec4(v.rgb,1);}`;
// A segment as a strip of two triangles, so that lines have a width.
const LINE = `uniform mat4 m;uniform vec2 z;uniform float s,l;in vec2 p;in vec3 a,b;in vec2 g;in vec4 k;in float t;out vec4 v;
void main(){vec4 x=m*vec4(a,1),y=m*vec4(b,1);x.w=max(x.w,1e-3);y.w=max(y.w,1e-3);vec2 d=(y.xy/y.w-x.xy/x.w)*z;d=d/max(length(d),1e-6);
bool h=l>=0.&&(g.x==l||g.y==l);v=k;if(h)v.a=1.;else if(l>=0.)v.a*=.35;
gl_Position=mix(x,y,p.x);gl_Position.xy+=vec2(-d.y,d.x)*p.y*(t*.1+(h?.6:0.))*s/z*gl_Position.w;if(k.a==0.)gl_Position=vec4(2,2,2,1);}`;
const FLAT = `in vec4 v;out vec4 o;void main(){o=v;}`;

/** Programs and buffers in a context; null where a program cannot be made. */
export function drawing(gl: WebGL2RenderingContext, divided: boolean): Drawn | null {
  const program = (vertex: string, fragment: string) => {
    const p = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;${text}`);
      gl.compileShader(shader);
      gl.attachShader(p, shader);
    }
    gl.linkProgram(p);
    return gl.getProgramParameter(p, gl.LINK_STATUS) ? p : null;
  };
  const [spheres, dots, lines] = [program(SPHERE, SHADE), program(DOT, DISC), program(LINE, FLAT)];
  if (!spheres || !dots || !lines) return null;
  const mesh = icosphere(divided);
  const buffer = (data?: BufferSource, target: number = gl.ARRAY_BUFFER) => {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    if (data) gl.bufferData(target, data, gl.STATIC_DRAW);
    return made;
  };
  const buffers = Array.from({ length: 8 }, () => buffer());
  type Attribute = [name: string, buffer: number | WebGLBuffer, size: number, stride?: number, offset?: number];
  // Numbered buffers change with the data and count by instance; the last two of each four hold bytes.
  const array = (p: WebGLProgram, divisor: number, attributes: Attribute[]) => {
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    for (const [name, from, size, stride = 0, offset = 0] of attributes) {
      const at = gl.getAttribLocation(p, name);
      const own = typeof from === "number";
      const bytes = own && from % 4 > 1;
      gl.bindBuffer(gl.ARRAY_BUFFER, own ? buffers[from]! : from);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, bytes ? gl.UNSIGNED_BYTE : gl.FLOAT, bytes && size > 1, stride, offset);
      gl.vertexAttribDivisor(at, own ? divisor : 0);
    }
    return made;
  };
  const sphereArray = array(spheres, 1, [["p", buffer(new Float32Array(mesh.vertices)), 3], ["o", 0, 3], ["a", 1, 3, 36], ["b", 1, 3, 36, 12], ["c", 1, 3, 36, 24], ["k", 2, 4]]);
  buffer(new Uint16Array(mesh.faces), gl.ELEMENT_ARRAY_BUFFER);
  const dotArray = array(dots, 0, [["o", 0, 3], ["k", 2, 4], ["h", 3, 1]]);
  const lineArray = array(lines, 1, [["p", buffer(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1])), 2], ["a", 4, 3, 24], ["b", 4, 3, 24, 12], ["g", 5, 2], ["k", 6, 4], ["t", 7, 1]]);
  let count = 0;
  return {
    fill(arrays) {
      arrays.forEach((data, i) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffers[i]!);
        gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      });
      count = arrays[3].length;
    },
    draw(matrix, eye, size, ratio, selected, segments, dot, ground) {
      gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
      gl.clearColor(ground[0]!, ground[1]!, ground[2]!, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      const use = (p: WebGLProgram, vertices: WebGLVertexArrayObject) => {
        gl.useProgram(p);
        gl.bindVertexArray(vertices);
        gl.uniformMatrix4fv(gl.getUniformLocation(p, "m"), false, matrix);
        return (name: string, ...value: number[]) => gl[`uniform${value.length as 1 | 2 | 3}fv`](gl.getUniformLocation(p, name), value);
      };
      gl.enable(gl.CULL_FACE);
      use(spheres, sphereArray)("e", ...eye);
      gl.drawElementsInstanced(gl.TRIANGLES, mesh.faces.length, gl.UNSIGNED_SHORT, 0, count);
      gl.disable(gl.CULL_FACE);
      use(dots, dotArray)("s", dot * ratio);
      gl.drawArrays(gl.POINTS, 0, count);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthMask(false);
      const set = use(lines, lineArray);
      set("z", ...size);
      set("s", ratio);
      set("l", selected);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, segments);
      gl.depthMask(true);
      gl.disable(gl.BLEND);
    },
  };
}
