"""Files that once ended in anything but a result or one line, as they were found."""

from __future__ import annotations

import base64
import zlib


def _unpacked(text: str) -> bytes:
    return zlib.decompress(base64.b85decode("".join(text.split())))


# zlib and base85
_MF4 = r"""
c-r%IaZ>;R6Fox%5S^Htl4hZ2p~nCOvltl&0%c_n7Z9BR<+DNQ56lpH2Qz;CD`1S-
m6E#3uO&cCCam`Og6#=F6SwhjNzTvBP0cH@<FW~f&<BzretuqjK~a7|YEemMYB5MqAE6Fvo=X&nmPPZUO9&%_B#?H1dgLusyn-
=Vf^`ckFH3@xqpP#G`}r2n;ALlLn5N%rYV8)&kKC2>vuo<=u=SC<^ZvH+N}K21+EV#>nr`&=yxZGqfA`5+m%qEUwfg%!+v@M{Zf~
!*Z?;Wkcylb!!J45n_0ESw&EoR={`@$6;K-q42ag_BSI|(=QPNV=Q`A(|Rn}HtzhJ?N6-$<^S+i)-
s#VLDty{Nn;mVaum#$sAc=77h%a^a`@2+PzVq{hpHs;orzA18);i|<XO^vhX4xT)E_VDTB{epE}UZ=EHWxbM`6?MyMSJf}JHn(GH
%hH~SO$)nbwyn(B{%`P$dN($<E&+z##Byn*@OjLD89qWlx`744-
#i4vXDI{2PVux3lytQNJzcqZz|$2dUjWmVU2;)sVo7R>jXsbK5iH5i&xy}Wu}dsY%mro~8-
17nl5|;WUP^uuni8lWin5~O%=|n%Q06nTfGdLt0@E+TJy3VMd4OmOsCzN;3@qQ}H>2b$V7$76*bY!>Xf!eyz!+Q*>IcsJj$J<tB=
A6J2_{_nLn1)50-AV9W^O7z`C_<!XFm|V0Ltfp(lc05)fcefFLx%O$uluR1RSsgAvpk-
Kimk&XZzvzX9F9m`UqD1?x?_!X91f<YkwvZkk8dGjx)mJPY-rf^$u+K-
I0JH&%_`ABn4>f&r$;EvVa3sy#_n!b_+qx17)fIP(W>e<YeZ-
{NW4^PaOFh7hq(>Rda(|1NN|J#1&2!oM<}G!byOGup5NY{6&lSE=f$n8{g<af|GQ+#nH^8g+Br+OEU8F!2WQ@)_#M54FnRv1E~LC
%_s+S|3l?)g_i*LU@Nz=yK@KkU@LctOMe4jZsJd08C;a5FCi!m0A_t=uK
"""
_UFF = r"""
c-rli%}x|S5P&zv7&9>j6amGb0u}_<S-NL-b{8+sWiKAqgPu*$AR#W0$P3If`2x-(_y`<5a^%3lo$0TJ?cI%u37BZ;Y`V6-
uIjFubXALpgf<w?l5{^7LToulQVnaXzln9+jLb6mKlrpe7>Et}Z~MI<w&9zd!!T-
#{r1Y3;m`4Mx;U`f#EhtgjrgOmj;Ae{^5n^Y+O1Jv(=^5CHO$b!Hn)@5M!nF)-
b%HL?f79CdB1<KE92u>Cdb7d(fA(k_V*5V24nVL`oG!3bLY!kFJCYJ7t0fsEK}j7>`^PnX6|HwTuhy;qyPNw<TCsz{QR|(>+m`Ft
kbjS=r@r|@D+4Mwu1kX+N(c&7Cwi*uICqV$uJ)Hvc^kXb@-
y@hrWrt17F}g&G*#hn+bN$;Ad{%Yz_VZK7+o2ehc{szKZ^X@2L4chTlNfeDA^U6PM;&Lq36Pz9+=BivL6SZR|GScj5EsYk7Hzc<`
>^-TQiU^m)p=7yZR|ul0|;dk0&`AEK)$^~-A)N$!_D?I7!>e*2)UWHI_F*VN)4!e_8+!}S_#o9Jj+AYZ~G^b^V|hQEN%qj!-
~U3+(4l6qxQ+k%_aE4Qqb`{k)+yPf)FuI1lKy>?O4e4Ar!NAs=w?JLuKwcRz~ny<Fa2>*uPezQ*Qw`*-
{Z9N~^gj<cb{EmNAIKKcf5_?b
"""
_MF4_TIMES = r"""
c-qZaOK%!i6do|a7~2@|3%{{3HhzJ5*v1KgE5&u#BuXVOylR3BRjdZEfL86MV$nqxT~t+7Sy5H>-
Sm~dTQ_aW{Rv)X>1CvDvdp53GR$|#0UKx=Tk0%)XYM!WyXV|F=Q|f)+1PZdSIFyMR>wp-`Fz+L_A2G;woYkzxm@uLb-
amZBgXwsZM@Oh-2M*TJo9SsS=XNq^;Uo4I#(*|T&tUp#5Z=b>2xYnh?*l?+rIK&^*NilzL(4HrE-PcR9>C*J$Vm&8(Zr5z}U>YIj
M~+Qc?cNUTkfvqeE!V<5Ewdyd2ZUX^p5D7Hw_V-
6EieC2e#Fg8^2r0h$!#&bf1dUXRfl8c9$XjUapj&|erI#oF6p^(LlfG{T}^noNM+0@R04mqbSg2;T-
|gBw<9HpA*24JyvUjaAu6AABEH1`xVLR~HCx0~!J0l<e+?)w>{^g4LR^SOC2jtKDw9=;;CB`(y>eMQOF-tq*7|5C(+J2Ixcb5LQP
eyB&ldQCxt6vbPsjAJcAta9;HF0s4gY5LN@SzaNC3($2#wEC&W)^%;FHB!E*44pMc{R|cV5IvgPUoN@y@zaoZ)VD$xM6h@O69tQL
!<sk@ta%2RAUjcG}a9NCw!s=^4W>_h5Yz%jI0nH(!LUMc@gx>(_LddgXVggp*0vZJ2sB}6}4S<TM6lGmZPJ-||N@#4<u$Y>H6`-
OMgdXW~VXg0BH37nqn4Z=Miv&Hcj&3)segL5xgnl_QgS7xD{UG#;*;#n_BOt4w&^;bl5#)i@s+^m{T0a3YO8PkS^YD<MVL@MeVF6
Y@19IVet%=1&tVPgaiSlu22_F6eh$>}4dcCkBXcUA2;qzgw13-F80A+a@9ukB~DF&q9k9U3rWJg>JA`rk@1oaA1onR0i-
owt%P+T$;g4I1z07<&IvVxi40F4O}+SOHf2&gzoJ1^GOVD&q!jwn?{IE=Lb6<r|o%Jp@4cpq;MfzU6`pNG}`YRMs^N*69*tv^8M0
Thyv2s{L&SU~6z7cau91ZV(O!!jDhS_HYNQe-TqtM)a0qb`LYZp3ud-uGgxPqDtl`Vi|otk1B%!ukm78>~;TzQFnb(|xA%OxKx?G
u>u7&2*XRFw<S8vrJc+jxyb3I>~gA=^)cRrgKc!n2s^sVmifiiRlp29i}r(SD214-
C#Pwbb;vrt9w@Gtgcxdv$|z<%IcEUA*(x9XRNMR9kIG$b;9a`)d9<Umgkkc*3N$i_2<9Mc=i0Jo?pvn!01jcl_;c=5nuUUn=E9rx
32FdqltVXT|VGOd^Ew}mr|KzHdprwCTm{H<#)50sCq~agsZP<ljU>f6Mt|f+>BTHJ^ZaN%R5vd#)F#kZ@G>ytM??hREiH!Mn|ZN#
|_V-C)?8{P&S9{&CjyVy7|IxI@Ju%SM4udtyD0cNghOZ?fZ_d=4a|~9j@1Dkq9=|ru_G-
Q5>5s@E5K&kJDqRGw5#ahw~V2sBoQioQW2A+LwPW&?L@Bb#Xpy5vR#=JWlJeI1Q&B=Zh`!(qXNA|IqU9*LHwUe}>;HzmvF?N><{y
RB7W4>bqh0*ERZut^HJ_GHtX^_1At+?ejrTYafQ{_|9UVuDw#Ynax!8>GDbcpP*~Ih5kru&8ev-
Pb=p!U=8cT_J7m6ll|PcKYjk2PBs6}F8?}CHUFCDSKRh=`DF(7H?S|5_y
"""
_LVM_START = r"""
c-n20OK;mS49CyZr`S2OQ9Ud_jzgNE1KJ+eHq9<GlvUk~`cc@<_n(|vBm*=E5}6SBBl#zN>yG;$yXP-=-c6^`cfOxNJde%n$9nI_sTq3E;-_~n
7lsG_?nXBcBRsmJxb}aV&b2jJ6LEKH=cc|1j!pk}g8M-n>g~{;x_$!x3g3=Xc$mG|Y&N_8r5;|-cl{WiL4er)bA9jI2{eFsaNT?BC&;tqD}L2a
eKXg$?&w>1yNB*-`mG_vzivYQ=L{di>ElNnB*;X0Bg^nFcV8uheB0U8hviwS${MBZ#re~uU?J>Xd-Cud9BhYfX_kOg>BP$A1F2TY`6PqcB>HRy
MaFzRL0YUni@%Ikosm^0#fN*2-X(GnDJT-C3XLi{6B@G!-VAP|RS`RjnWq_*qcCQw869gUc#an<a<5`cZP18y6B@6jim@@GD$z(ymsB?8s2CgT
QN+f&LkBFYF<Lb*Jw_#ZK~fMtMS;Q`SS)gNCN>G4Dn`fQP&pcLh(e>$oy{AA8=M1zTkJ={%8{sr<wdS^f|n!)(L<y)rk0cvvPla`S}?dpEr^|A
I}Fo8lNOAwaTFxms@RW`{43PL@TFSm1g}U7!<Q;*K_PW?mVBvj4j4Pbb{Mu)u^skesZd|TmujU`%!0Hae5f~Sq1jfgaKp9=rLcUfq7<Z$p>B|p
nv#_K{T7wbY^!2B@{9Ky&MV^o13#TUz5
"""

FOUND: dict[str, tuple[str, bytes]] = {
    # ZeroDivisionError in the search for the simplest rate
    "TRC log whose first frames have one time": (
        "can trc",
        b";$FILEVERSION=1.1\n;$STARTTIME=44548.6\n;\n"
        + b"".join(b"%6d)  %11.1f  Rx  0123  1  05 \n" % (n, t) for n, t in enumerate([0] * 6 + [900, 2000], 1)),
    ),
    # two gigabytes and more than ten seconds
    "DBC with a signal of enormous length": (
        "database",
        b'VERSION ""\nNS_ :\nBS_:\nBU_: rig\nBO_ 291 L: 8 rig\n SG_ F : 0|4000000000@1- (1,0) [0|0] "N" rig\n',
    ),
    # KeyError: 'data'
    "UFF set with a broken header": ("uff binary", _unpacked(_UFF)),
    # a segmentation fault of asammdf
    "MF4 channel with its invalidation bit far outside the record": ("mf4", _unpacked(_MF4)),
    # OverflowError, as the times are of all sizes that a float has
    "MF4 times of which an index does not fit into 64 bits": ("mf4", _unpacked(_MF4_TIMES)),
    # OverflowError, as one column begins beyond all steps of a float
    "LVM column that begins at 1e308 s": ("lvm", _unpacked(_LVM_START)),
}
"""What it was → target and content."""
